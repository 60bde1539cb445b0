"""Recipe store: revisions, approvals, and the recipes in force, beside the recipe files."""

"""The recipes' history beside their files: revisions, who approved them, and by which of them fruit is inspected."""

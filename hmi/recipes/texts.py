"""Texts of the page Recipes."""

from hmi.web.text import define

define("recipes.shipped", "These recipes come with the software and cannot be edited here. How to make your own")
define("recipes.shipped_copy", "On the station's machine, as its user:")
define("recipes.shipped_name", "In station.yaml:")
define(
    "recipes.shipped_start",
    "Restart the station. The recipes in force stay in force; afterwards each recipe can be edited here.",
)
define("recipes.number", "PLC number {n}")
define("recipes.in_force", "Revision {n} in force")
define("recipes.not_in_force", "Not in force")
define("recipes.waits", "Revision {n} by {who} waits for approval")
define("recipes.file_draft", "Edited, not submitted")
define("recipes.file_broken", "File cannot be read")
define("recipes.file_missing", "File is missing")
define(
    "recipes.file_draft_long",
    "The file was edited and differs from the recipe in force. Submit it for approval, or restore it.",
)
define("recipes.import", "Import a file")
define("recipes.import_now", "Import as a draft")
define("recipes.file", "Recipe file (.yaml)")
define("recipes.reason", "Reason, for the audit trail")
define("recipes.tab_standing", "Status")
define("recipes.tab_edit", "Edit")
define("recipes.tab_history", "History")
define("recipes.tab_text", "File")
define("recipes.changes", "What would change")
define("recipes.no_changes", "No difference from the recipe in force.")
define("recipes.value", "Value")
define("recipes.old", "In force")
define("recipes.new", "Draft")
define("recipes.decide", "Decide")
define("recipes.own_draft", "This is your own draft: another person has to approve it.")
define("recipes.approve", "Approve")
define("recipes.reject", "Reject")
define("recipes.submit", "Submit for approval")
define("recipes.revert", "Restore the file")
define("recipes.revert_to", "Restore revision {n} in the file")
define("recipes.whatif", "What would it have decided?")
define("recipes.whatif_last", "Last fruit")
define("recipes.slide", "{field}: slider")
define(
    "recipes.tried_diverted",
    "Of the last {n} fruit {decided} can be known: {after} diverted by these values, {before} before.",
)
define("recipes.tried_good", "Marked good and diverted: {after} of {n}, {before} before")
define("recipes.tried_bad", "Marked bad and passed: {after} of {n}, {before} before")
define("recipes.tried_right", "Now right:")
define("recipes.tried_wrong", "Now wrong:")
define("recipes.tried_unknown", "Marked fruit that cannot be known: {n}")
define(
    "recipes.tried_none",
    "No fruit of this recipe is marked good or bad. With marks (station records mark) both errors would be here.",
)
define("recipes.tried_invalid", "These values are no valid recipe together.")
define("recipes.log_in", "To change a recipe, log in as quality.")
define("recipes.bad_field", "{field}: expected {expected}")
define("recipes.nothing_changed", "No value was changed.")
define("recipes.open_anew", "Open the form with the present values")
define("recipes.rare", "Values that are seldom changed")
define("recipes.yes", "yes")
define("recipes.no", "no")
define("recipes.unit_grey_level", "grey level")
define("recipes.unit_grey_level/px", "grey level/px")
define("recipes.save", "Save as a draft")
define("recipes.revision", "Revision {n}")
define("recipes.status_draft", "Draft")
define("recipes.status_approved", "In force")
define("recipes.status_retired", "Retired")
define("recipes.origin_submitted", "Submitted by")
define("recipes.origin_shipped", "Shipped by")
define("recipes.origin_adopted", "Adopted by")
define("recipes.approved_by", "Approved by")
define("recipes.retired_by", "Retired by")
define("recipes.no_history", "No history yet.")
define("recipes.export", "Export")

"""Texts of the page Recipes."""

from hmi.texts.text import define

define(
    "recipes.shipped",
    "These recipes come with the software and are not edited in place. How to get recipes of one's own",
)
define("recipes.shipped_copy", "On the station's machine, as its user:")
define("recipes.shipped_name", "In station.yaml:")
define(
    "recipes.shipped_start",
    "Start the station again. What is in force stays so; from then on each recipe can be edited here.",
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
    "The file was edited and is not what is in force. Submit it for approval, or put it back.",
)
define("recipes.import", "Import a file")
define("recipes.import_now", "Import as a draft")
define("recipes.file", "Recipe file (.yaml)")
define("recipes.reason", "Reason, for the audit trail")
define("recipes.tab_standing", "Standing")
define("recipes.tab_edit", "Edit")
define("recipes.tab_history", "History")
define("recipes.tab_text", "File")
define("recipes.changes", "What would change")
define("recipes.no_changes", "Nothing differs from what is in force.")
define("recipes.value", "Value")
define("recipes.old", "In force")
define("recipes.new", "Draft")
define("recipes.decide", "Decide")
define("recipes.own_draft", "This is your own draft: another person has to approve it.")
define("recipes.approve", "Approve")
define("recipes.reject", "Reject")
define("recipes.submit", "Submit for approval")
define("recipes.revert", "Put the file back")
define("recipes.revert_to", "Put revision {n} back into the file")
define("recipes.whatif", "What would it have done?")
define("recipes.whatif_last", "Last fruit")
define("recipes.log_in", "To change a recipe, log in as quality.")
define("recipes.bad_field", "{field}: expected {expected}")
define("recipes.nothing_changed", "No value was changed.")
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
define("recipes.no_history", "There is no history yet.")
define("recipes.export", "Export")

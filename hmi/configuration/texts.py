"""Texts of the page Configuration."""

from hmi.web.text import define

define("configuration.tab", "Configuration")
define("configuration.no_file", "The station uses its default settings: there is no configuration file to edit.")
define(
    "configuration.next_start",
    "A change takes effect at the next start of the station. On an installation: {command}. Elsewhere end station run"
    " and start it again.",
)
define("configuration.saved", "Saved. It takes effect at the next start.")
define("configuration.not_saved", "Not saved: the text has mistakes. The file is as it was.")
define("configuration.broken", "The file has mistakes. Correct them before the next start.")
define("configuration.nothing_changed", "Nothing was changed.")
define("configuration.changed_meanwhile", "Not saved: the file was changed meanwhile. Open the page again.")
define("configuration.not_written", "Not saved: the file cannot be written: {detail}.")
define(
    "configuration.read_only",
    "The station may not write in {folder}, so the file is only shown. Edit it on the machine: {command}. The"
    " deployment guide says how to permit it on this page.",
)
define("configuration.line", "Line {number}")
define("configuration.environment", "Environment")
define("configuration.text", "Text of the file")
define("configuration.save", "Check and save")
define("configuration.former", "Put the former file back")

"""Texts of the page of a job."""

from hmi.texts.text import define

define("job.kind_export", "Table of inspections")
define("job.kind_lot_report", "Report of a lot")
define("job.kind_whatif", "What a draft would have done")
define("job.state_waiting", "Waits for its turn")
define("job.state_running", "Under way")
define("job.state_done", "Done")
define("job.state_failed", "Could not be done")
define("job.state_ended", "Called off")
define("job.progress", "{done} of {of}")
define("job.open", "Open {name}")
define("job.save", "Save {name}")
define("job.end", "Call off")

"""Texts of the page of a job."""

from hmi.web.text import define

define("job.kind_export", "Table of inspections")
define("job.kind_lot_report", "Report of a lot")
define("job.kind_whatif", "What a draft would have decided")
define("job.state_waiting", "Waiting")
define("job.state_running", "In progress")
define("job.state_done", "Done")
define("job.state_failed", "Failed")
define("job.state_ended", "Cancelled")
define("job.progress", "{done} of {of}")
define("job.open", "Open {name}")
define("job.open_alone", "Open alone, to print")
define("job.save", "Save {name}")
define("job.end", "Cancel")

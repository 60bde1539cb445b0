"""Texts of PackML's states."""

from hmi.texts.text import define

define("packml.unknown", "Starting up")
define("packml.clearing", "Clearing")
define("packml.stopped", "Stopped")
define("packml.starting", "Fruit accepted")
define("packml.idle", "Ready")
define("packml.suspended", "Suspended")
define("packml.execute", "Inspecting")
define("packml.stopping", "Stopping")
define("packml.aborting", "Stopping at once")
define("packml.aborted", "Safety stop")
define("packml.holding", "Holding")
define("packml.held", "Held")
define("packml.unholding", "Continuing")
define("packml.suspending", "Suspending")
define("packml.unsuspending", "Continuing")
define("packml.resetting", "Resetting")
define("packml.completing", "Inspecting")
define("packml.completed", "Inspected")

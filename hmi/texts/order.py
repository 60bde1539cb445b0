"""Texts of the operators' commands."""

from hmi.texts.text import define

define("order.choose_recipe", "Change fruit")
define("order.start", "Start")
define("order.stop", "Stop")
define("order.call_off", "Abort this fruit")
define("order.recover", "Recover the arm")
define("order.set_mode", "Change the mode")
define("order.start_lot", "Start the lot")
define("order.end_lot", "End the lot")
define("order.is_executing", "in progress.")
define("order.is_done", "done.")
define("order.is_failed", "not done.")

"""Texts of the page Run."""

from hmi.web.text import define, define_plural

define("run.state", "State")
define("run.last_fruit", "Last fruit")
define("run.figures", "Figures")
define_plural("run.recent", "The last fruit", "The last {n} fruit", "n")
define("run.no_fruit", "No fruit since the station started.")
define("run.number", "Number")
define("run.at", "at")
define("run.details", "Details")
define_plural("run.more_reasons", "and {n} more reason", "and {n} more reasons", "n")
define("run.other_reasons", "Other reasons")
define("run.fruit", "Fruit")
define("run.revision", "revision")
define("run.ended", "Ended")
define("run.took", "Duration")
define("run.picture", "The sensor's image at the deciding step, with the contact's outline")
define("run.no_picture", "No image was taken.")
define_plural(
    "run.curve_label",
    "Contact area over closing, {points} point; decided at {area} mm²",
    "Contact area over closing, {points} points; decided at {area} mm²",
    "points",
)
define("run.trend_axis", "one bar per {n} fruit, the newest at the right")
define("run.trend_label", "Rejected out of ten fruit each, oldest first: {figures}")
define("run.lot", "Lot")
define("run.no_lot", "none yet")
define("run.change_lot", "Change")
define("run.counts", "Fruit of this lot")
define("run.reject_rate", "Rejected")
define_plural("run.of_last", "of the last one", "of the last {n}", "n")
define("run.cycle_time", "Cycle time")
define("run.takt", "one fruit every {takt} s")
define("run.stops_after", "stops after this fruit")
define("run.confirm_start", "The cell is safe, start")
define("run.recover.protective-stop", "Confirm protective stop")
define("run.recover.power", "Power on, release brakes")
define("run.recover.program", "Start the arm's program")
define("run.fruit_number", "Fruit {n}")
define("run.explanation", "Why")
define("run.plc_names_lots", "The line's PLC names the lots.")
define("run.lot_text", "The lot keeps the recipe that is approved at its first fruit.")
define("run.lot_now", "Current lot:")
define("run.lot_name", "Name of the new lot")
define("run.grower", "Grower, if known")

"""Messages of the maintenance page: why nothing may be moved by hand, and why no contact is shown."""

from station.messages.message import Nested, Number, define

ENDING = define("maintenance.ending", "The station is ending.")
BUSY = define("maintenance.busy", "An inspection is under way: wait for its end.")
SET_MANUAL = define(
    "maintenance.set_manual",
    "The station is in mode {mode}: set manual mode, {manual}, first. It accepts no fruit then.",
    mode=Number(),
    manual=Number(),
)
UNDER_WAY = define("maintenance.under_way", "Under way: {activity}. Let it end, or abort it.", activity=Nested())
IMAGE_BUSY = define("maintenance.image_busy", "An inspection is under way: the image is shown as it is.")
IMAGE_NO_RECIPE = define("maintenance.image_no_recipe", "No recipe is active: its method measures the contact.")
JOG_WIDTH = define(
    "maintenance.jog_width", "to jog the gripper: give a width if it is to move to one, and none otherwise"
)
JOG_TOO_WIDE = define(
    "maintenance.jog_too_wide", "the fingers open to {widest_mm} mm, not to {width_mm} mm", widest_mm=Number(1)
)
JOG_MOVING = define("maintenance.jog_moving", "the fingers are already moving: wait for them, or stop them")
NO_GOLDEN = define(
    "maintenance.no_golden", "There is no golden reference yet: calibrate, or let the station inspect once."
)
GOLDEN_UNREADABLE = define(
    "maintenance.golden_unreadable", "The golden reference {file} cannot be read: calibrate again."
)
GOLDEN_SIZE = define(
    "maintenance.golden_size", "The image has another size than the golden reference: calibrate again."
)

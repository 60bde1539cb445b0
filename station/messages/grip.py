"""Messages of a grip: why it did not end as planned, what the jaws do, and why an image may not be the reference."""

from station.messages.message import Listed, Nested, Number, define

BAD_FRAMES = define(
    "grip.bad_frames",
    "the camera gave {number} bad frames in a row ({faults}); see `station devices check`",
    faults=Listed(),
)
UNSEEN_CONTACT = define(
    "grip.unseen_contact",
    "the gripper holds something at {width_mm} mm which the gel does not show: look for what is between the "
    "fingers beside the gel, then `station devices check`",
    width_mm=Number(1),
)
NOTHING_TOUCHED = define(
    "grip.nothing_touched",
    "nothing was touched from {largest_mm} down to {smallest_mm} mm: check that a fruit ({recipe}) is in the nest, "
    "and that the arm is there",
)
CALLED_OFF = define("grip.called_off", "the grip was aborted")
NOT_OPENED = define(
    "grip.not_opened", "The gripper could not be opened, and the arm stays where it is: {reason}", reason=Nested()
)
NOT_LEFT = define("grip.not_left", "The gripper is open, and the arm stays where it is: {reason}", reason=Nested())
FAILED_NOT_OPENED = define(
    "grip.failed_not_opened",
    "{reason}. The gripper could not be opened either, and the arm stays where it is",
    reason=Nested(),
)
FAILED_NOT_LEFT = define(
    "grip.failed_not_left", "{reason}. The gripper is open, and the arm stays where it is", reason=Nested()
)
FAILED_TWICE = define("grip.failed_twice", "{reason}. {release}", reason=Nested(), release=Nested())
JAWS_NOT_OPEN = define(
    "grip.jaws_not_open",
    "the jaws are at {width_mm} mm and not open, {open_mm} mm: take out what holds them",
    width_mm=Number(1),
    open_mm=Number(1),
)

REFERENCE_SATURATED = define(
    "grip.reference_saturated",
    "reference: {found}% of it are saturated, at most {limit}% may be: keep outside light off the gel, or lower "
    "the LEDs",
    found=Number(0),
    limit=Number(0),
)
REFERENCE_BLURRED = define(
    "grip.reference_blurred",
    "reference: {found}% as sharp as the golden reference, at least {limit}% are needed: clean the sensor's lens "
    "and gel",
    found=Number(0),
    limit=Number(0),
)
REFERENCE_LIGHT = define(
    "grip.reference_light",
    "reference: its light differs from the golden reference's by {levels} grey levels: look at the sensor's LEDs; "
    "after a change of gel or sensor {renewal}",
    levels=Number(0),
    renewal=Nested(),
)
REFERENCE_TOUCHED = define(
    "grip.reference_touched",
    "reference: something touches the gel that the golden reference does not have: take it out and wipe the gel; "
    "if the gel was changed, {renewal}",
    renewal=Nested(),
)
RENEW_BY_CALIBRATION = define("grip.renew_by_calibration", "calibrate")
RENEW_BY_REMOVAL = define("grip.renew_by_removal", "remove {file} from the home folder")

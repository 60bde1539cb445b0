"""Messages of the camera: why it gives no frames, what is wrong with a frame, and what its check found."""

from station.messages.message import Listed, Nested, Number, define, define_plural

DIGIT = define("camera.digit", "DIGIT {serial}")
TWIN = define("camera.twin", "twin at {address}")
REPLAY = define("camera.replay", "replay of {source}")

NO_FRAME = define(
    "camera.no_frame",
    "camera {camera}: no new frame within {limit_s} s; {reasons}. {remedy}, then `station devices check`",
    camera=Nested(),
    reasons=Listed("; "),
    remedy=Nested(),
)
NEWEST = define("camera.newest", "the newest is {age_s} s old", age_s=Number(1))
NOTHING_SENT = define("camera.nothing_sent", "it has sent nothing yet")
REMEDY_CABLE = define("camera.remedy_cable", "Check its cable and its light")

NO_FIRST_FRAME = define(
    "camera.no_first_frame", "camera {camera}: no frame within {limit_s} s; {reason}", camera=Nested(), reason=Nested()
)
NOT_PLUGGED_IN = define(
    "camera.not_plugged_in", "no DIGIT {serial} is plugged in (found: {found}); check cable and serial number"
)
NONE_PLUGGED_IN = define(
    "camera.none_plugged_in", "no DIGIT {serial} is plugged in, and no other one; check cable and serial number"
)
NOT_OPENED = define(
    "camera.not_opened",
    "{node} cannot be opened; check that no other program uses it and that the user is in the group video",
)
NO_MORE_FRAMES = define("camera.no_more_frames", "{node} gives no frames any more; the station searches it again")
READING_FAILED = define("camera.reading_failed", "reading it failed: {reason}")
WRONG_MODE = define(
    "camera.wrong_mode",
    "DIGIT {serial}: {width}x{height} at {rate} frames/s was requested, the driver gave "
    "{given_width}x{given_height} at {given_rate}; plug it into a USB port of its own and try again",
    width=Number(),
    height=Number(),
    rate=Number(),
    given_width=Number(),
    given_height=Number(),
    given_rate=Number(),
)
LIGHT_FIRMWARE = define(
    "camera.light_firmware", "its light cannot be set colour by colour: write firmware {revision} or newer to it"
)
LIGHT_REFUSED = define("camera.light_refused", "it refused its light's setting: unplug it and plug it in again")

TWIN_NO_FIRST_FRAME = define(
    "camera.twin_no_first_frame",
    "camera twin at {address}: no frame within {limit_s} s; {reason}. Start it with `station twin`, or correct "
    "camera.twin in station.yaml",
    reason=Nested(),
)
TWIN_LIGHT_NOT_SET = define(
    "camera.twin_light_not_set",
    "camera twin at {address}: the light could not be set; {reason}",
    reason=Nested(),
)
TWIN_LIGHT_REFUSED = define("camera.twin_light_refused", "camera twin at {address}: the light was refused: {reason}")
TWIN_NO_TRUTH = define("camera.twin_no_truth", "camera twin at {address}: no true mask of this frame: {reason}")
TWIN_TRUTH_NOT_READ = define(
    "camera.twin_truth_not_read",
    "camera twin at {address}: the true mask could not be read; {reason}",
    reason=Nested(),
)
LINK_CLOSED = define("camera.link_closed", "the connection was closed")
LINK_SILENT = define("camera.link_silent", "nothing came for {limit_s} s")
LINK_FAILED = define("camera.link_failed", "the connection failed: {reason}")
LONG_HEADER = define(
    "camera.long_header",
    "it announced a header of {found} bytes; at most {limit} are allowed",
    found=Number(0),
    limit=Number(0),
)
UNREADABLE_HEADER = define("camera.unreadable_header", "it sent a header that is no JSON: {reason}")
WRONG_HEADER = define("camera.wrong_header", "it sent a header that is no JSON object")
NO_FRAME_HEADER = define("camera.no_frame_header", "it sent {kind} where a frame was expected: {reason}")
WRONG_AGE = define(
    "camera.wrong_age",
    "it sent age_s {found}; expected seconds, from 0 to less than {limit}",
    limit=Number(),
)
WRONG_SIZE = define(
    "camera.wrong_size",
    "it sent a frame of {width}x{height} pixels; 1 to {limit} a side are allowed",
    limit=Number(),
)
WRONG_LENGTH = define(
    "camera.wrong_length",
    "it sent {found} bytes for {width}x{height} pixels of 3 bytes",
    width=Number(),
    height=Number(),
)
NOT_WHOLE = define("camera.not_whole", "it sent {key} {found}; expected a whole number, 0 or more")
WRONG_ORDER = define("camera.wrong_order", "it sent frame {found} after frame {before}; the numbers must rise")

REPLAY_EMPTY = define("camera.replay_empty", "replay: {source} holds no image; expected a folder of images or a video")
REPLAY_NOT_OPEN = define("camera.replay_not_open", "replay: a frame was requested before it was opened")
REPLAY_UNREADABLE = define(
    "camera.replay_unreadable", "replay: {file} is no image that can be read; remove it or record it again"
)
REPLAY_MISSING = define(
    "camera.replay_missing", "replay: there is no folder or video {source}; correct camera.replay.source"
)
REPLAY_ENDED = define("camera.replay_ended", "the recording has ended")
REMEDY_REPLAY = define(
    "camera.remedy_replay",
    "Start again to play it from its beginning, or name a longer one in camera.replay.source",
)

FRAME_STALE = define("camera.frame_stale", "too old")
FRAME_REPEATED = define("camera.frame_repeated", "repeated")
FRAME_TORN = define("camera.frame_torn", "torn")
FRAME_SHIFTED = define("camera.frame_shifted", "shifted")
FRAME_BLACK = define("camera.frame_black", "black")
FRAME_SATURATED = define("camera.frame_saturated", "saturated")
FRAME_WRONG_SIZE = define("camera.frame_wrong_size", "of another size")
BAD_FRAMES = define_plural(
    "camera.bad_frames",
    "camera: {number} bad frame ({faults}); check its cable and its light, then `station devices check`",
    "camera: {number} bad frames in a row ({faults}); check its cable and its light, then `station devices check`",
    "number",
    faults=Listed(),
)

CHECK_FOUND = define("camera.check_found", "{camera}, {width_px}x{height_px}, {rate} frames/s", rate=Number(1))
CHECK_REVISION = define(
    "camera.check_revision", "{camera}, revision {revision}, {width_px}x{height_px}, {rate} frames/s", rate=Number(1)
)
CHECK_BAD = define(
    "camera.check_bad",
    "{found}; of {number} frames {bad} are bad: {faults}",
    found=Nested(),
    bad=Number(),
    faults=Listed(),
)
CHECK_NONE = define("camera.check_none", "driver {driver}: no usable camera")
REMEDIES = define("camera.remedies", "{remedies}", remedies=Listed("; "))
REMEDY_STALE = define(
    "camera.remedy_stale",
    "the computer or the link is too slow: close other programs, use a USB port of its own",
)
REMEDY_REPEATED = define("camera.remedy_repeated", "the sensor is frozen: unplug it and plug it in again")
REMEDY_BROKEN = define("camera.remedy_broken", "the USB link drops data: change cable or port")
REMEDY_BLACK = define("camera.remedy_black", "no light: check the LED settings and the sensor's cable")
REMEDY_SATURATED = define("camera.remedy_saturated", "too much light: lower the LED settings, shade the gel")
REMEDY_WRONG_SIZE = define(
    "camera.remedy_wrong_size",
    "another mode than requested: close other programs that use the sensor",
)
REMEDY_SLOW = define(
    "camera.remedy_slow",
    "{rate} frames/s were expected: close other programs, use a USB port of its own",
    rate=Number(),
)

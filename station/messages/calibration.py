"""Messages of calibration and verification: steps, checks with their remedies, and why none is stored."""

from station.messages.message import Listed, Nested, Number, define, define_plural

A_CALIBRATION = define("calibration.a_calibration", "a calibration")
A_VERIFICATION = define("calibration.a_verification", "a verification")
A_GEL_CHANGE = define("calibration.a_gel_change", "a change of the gel")

# Titles of the steps.
STEP_UNTOUCHED = define("calibration.step_untouched", "the untouched gel")
STEP_PRESS = define("calibration.step_press", "the ball, step by step")
STEP_ONSET = define("calibration.step_onset", "where the contact begins")
STEP_PLACE = define("calibration.step_place", "the ball at another place")
STEP_JUDGE = define("calibration.step_judge", "the result")

# Progress of the steps.
FRAMES = define("calibration.frames", "{number} frames, nothing may touch the gel")
ONSET_BETWEEN = define(
    "calibration.onset_between", "between {wider_mm} and {narrower_mm} mm", wider_mm=Number(1), narrower_mm=Number(1)
)
ONSET_FROM = define("calibration.onset_from", "from {width_mm} mm", width_mm=Number(1))
AREA_AT = define("calibration.area_at", "{width_mm} mm: {area_px} px", width_mm=Number(2))
NO_CONTACT_AT = define("calibration.no_contact_at", "{width_mm} mm: no contact", width_mm=Number(2))
PLACE = define("calibration.place", "place {number}, {x_mm},{y_mm} mm")
PLACE_SEEN = define(
    "calibration.place_seen", "{place}: at {x_px}, {y_px} px", place=Nested(), x_px=Number(0), y_px=Number(0)
)

# Names of the checks.
CHECK_BALL = define("calibration.check_ball", "ball")
CHECK_ROUND = define("calibration.check_round", "round")
CHECK_STEPS = define("calibration.check_steps", "steps")
CHECK_RISING = define("calibration.check_rising", "rising")
CHECK_CONFIDENCE = define("calibration.check_confidence", "confidence")
CHECK_NOISE = define("calibration.check_noise", "noise")
CHECK_SCALE = define("calibration.check_scale", "scale")
CHECK_ONSET = define("calibration.check_onset", "onset")
CHECK_AREA = define("calibration.check_area", "area")
CHECK_TEAR = define("calibration.check_tear", "tear")
CHECK_DIRT = define("calibration.check_dirt", "dirt")
CHECK_LED = define("calibration.check_led", "LED")
CHECK_FOG = define("calibration.check_fog", "fog")
CHECK_WEAR = define("calibration.check_wear", "wear")

# What a check found, expected, and asks for.
CONTACT_BEGINS = define("calibration.contact_begins", "contact begins at {width_mm} mm", width_mm=Number(2))
WIDTH_EXPECTED = define("calibration.width_expected", "{width_mm} ± {tolerance_mm} mm", width_mm=Number(1))
ONSET_EXPECTED = define("calibration.onset_expected", "{width_mm} ± {tolerance_mm} mm", width_mm=Number(2))
DO_BALL = define(
    "calibration.do_ball",
    "another ball or holder, or the gripper's zero is off: look at the ball, then at "
    "gripper.calibration.finger_offset_mm",
)
AXES_DIFFER = define("calibration.axes_differ", "the contact's axes differ by {percent}%", percent=Number(0))
AXES_EXPECTED = define("calibration.axes_expected", "a ball's, at most {percent}%", percent=Number(0))
DO_ROUND = define("calibration.do_round", "lay the rubber ball in, upright between the fingers, and nothing else")
STEPS_WHOLE = define_plural(
    "calibration.steps_whole", "{number} step shows a whole contact", "{number} steps show a whole contact", "number"
)
AT_LEAST = define("calibration.at_least", "at least {value}", value=Number())
AT_MOST = define("calibration.at_most", "at most {value}", value=Number(2))
DO_STEPS = define("calibration.do_steps", "lay the rubber ball in the gel's middle, and nothing else")
AREA_RISES = define("calibration.area_rises", "the area rises at every step")
AREA_FALLS = define(
    "calibration.area_falls",
    "from {wider_mm} to {narrower_mm} mm the area goes from {before_px} to {after_px} px",
    wider_mm=Number(1),
    narrower_mm=Number(1),
)
NO_AREA = define("calibration.no_area", "no area")
RISE_EXPECTED = define("calibration.rise_expected", "an area that rises step by step")
DO_RISING = define(
    "calibration.do_rising", "clean gel and ball, see that the ball does not slip or roll, and try again"
)
WORST_CONFIDENCE = define("calibration.worst_confidence", "{value} at the worst step", value=Number(2))
DO_CONFIDENCE = define("calibration.do_confidence", "clean gel and lens, keep outside light off, and try again")
GATE_REACHED = define(
    "calibration.gate_reached", "with nothing touching the contact gate reaches {value}", value=Number(2)
)
DO_NOISE = define("calibration.do_noise", "keep outside light off, check the sensor's cable and light, and try again")
SCALE_FOUND = define("calibration.scale_found", "{scale_mm} mm/px ± {percent}%", scale_mm=Number(5), percent=Number(1))
SCALE_EXPECTED = define(
    "calibration.scale_expected", "{least_mm} to {most_mm} mm/px, known better than without a measurement"
)
DO_SCALE = define("calibration.do_scale", "lay the ball at exactly the requested places, and try again")
NOTHING_TOUCHED_NOW = define("calibration.nothing_touched_now", "nothing was touched")
DO_ONSET = define(
    "calibration.do_onset",
    "if it is the ball of the calibration, in its holder, the gripper's zero has moved: calibrate",
)
AREA_RATIO = define("calibration.area_ratio", "{percent}% of the calibration's area", percent=Number(1))
RATIO_EXPECTED = define(
    "calibration.ratio_expected", "{least_percent}% to {most_percent}%", least_percent=Number(0), most_percent=Number(0)
)
DO_AREA = define(
    "calibration.do_area", "look at the ball and how it lies, and at the gel; if both are as they were, calibrate"
)
NOISE_RATIO = define("calibration.noise_ratio", "{ratio} times the noise of the calibration", ratio=Number(1))
NOISE_EXPECTED = define("calibration.noise_expected", "at most {ratio} times", ratio=Number())
DO_NOISE_NOW = define("calibration.do_noise_now", "keep outside light off, check the sensor's cable and light")
AS_BEFORE = define("calibration.as_before", "as at the calibration")

# Health of the gel.
NO_TEAR = define("calibration.no_tear", "no tear is seen")
NO_DIRT = define("calibration.no_dirt", "no dirt is seen")
LEDS_BRIGHT = define("calibration.leds_bright", "every LED is as bright as it was")
NO_FOG = define("calibration.no_fog", "gel and lens are clear")
NOT_WORN = define("calibration.not_worn", "the gel responds as strongly as it did")
FOGGED = define(
    "calibration.fogged",
    "the untouched gel shows {percent}% of the detail it had: fogged or smeared",
    percent=Number(0),
)
LED_DEAD = define(
    "calibration.led_dead", "light of {colours} of what it was: an LED is dead or not connected", colours=Listed()
)
LED_DIM = define("calibration.led_dim", "light of {colours} of what it was: an LED has grown dim", colours=Listed())
LED_DEAD_OF_OTHERS = define(
    "calibration.led_dead_of_others",
    "light of {colours} of the other colours: an LED is dead or not connected",
    colours=Listed(),
)
RED = define("calibration.red", "red {percent}%", percent=Number(0))
GREEN = define("calibration.green", "green {percent}%", percent=Number(0))
BLUE = define("calibration.blue", "blue {percent}%", percent=Number(0))
TORN = define("calibration.torn", "a long thin line runs across the gel: it is torn or cut")
BLEMISHED = define_plural(
    "calibration.blemished",
    "{number} place on the gel, {percent}% of the field, looks like dirt or damage",
    "{number} places on the gel, {percent}% of the field, look like dirt or damage",
    "number",
    percent=Number(1),
)
NEWLY_BLEMISHED = define_plural(
    "calibration.newly_blemished",
    "{number} new place on the gel, {percent}% of the field, looks like dirt or damage",
    "{number} new places on the gel, {percent}% of the field, look like dirt or damage",
    "number",
    percent=Number(1),
)
WORN = define(
    "calibration.worn",
    "the ball changes the picture {percent}% as much as at the calibration: the coating is worn",
    percent=Number(0),
)
DO_CHANGE_GEL = define("calibration.do_change_gel", "change the gel, then calibrate")
DO_WIPE = define("calibration.do_wipe", "wipe the gel with a soft cloth and alcohol, then try again")
DO_LED = define(
    "calibration.do_led",
    "check the sensor's cable and light settings; a dead LED asks for another sensor, then calibrate",
)
DO_CLEAN = define("calibration.do_clean", "clean the sensor's lens and gel, then try again")

# Why no calibration is stored.
REFUSED = define("calibration.refused", "no calibration is stored: {reasons}", reasons=Listed("; "))
FAULT_AND_REMEDY = define("calibration.fault_and_remedy", "{fault}: {remedy}", fault=Nested(), remedy=Nested())
CHECK_FAILED = define(
    "calibration.check_failed",
    "{check}: {found}, expected {expected}: {remedy}",
    check=Nested(),
    found=Nested(),
    expected=Nested(),
    remedy=Nested(),
)
FRAMES_EQUAL = define(
    "calibration.frames_equal", "the frames do not differ at all: a live sensor's do; see `station devices check`"
)
TOUCHED_AT_START = define(
    "calibration.touched_at_start",
    "something touches the gel at the start, {width_mm} mm, and a {ball_mm} mm ball is met at {met_mm} mm: take it "
    "out, look for the right ball and what holds it",
    width_mm=Number(1),
    met_mm=Number(1),
)
NOTHING_TOUCHED = define(
    "calibration.nothing_touched",
    "nothing touched the gel down to {width_mm} mm: check that the ball is between the fingers; a smaller one is never "
    "met",
    width_mm=Number(1),
)
PLACE_UNSEEN = define(
    "calibration.place_unseen",
    "{place}: at {width_mm} mm no whole contact is seen: lay the ball nearer to the gel's middle, as high as before",
    place=Nested(),
    width_mm=Number(1),
)
PLACES_TOO_NEAR = define(
    "calibration.places_too_near", "expected places at least {least_mm} mm apart, the first is 0,0"
)
UNKNOWN = define("calibration.unknown", "there is no calibration {name}; see `station calibrate list`")
NOT_STORED = define(
    "calibration.not_stored",
    "{folder}: cannot be stored: {error}; free space there, or make it writable, and do it again: nothing was kept",
)
PICTURE_UNREADABLE = define(
    "calibration.picture_unreadable", "{file}: the calibration's picture cannot be read; calibrate again"
)

# Calibration in use, and what is due.
SUMMARY_MEASURED = define(
    "calibration.summary_measured",
    "{calibration}: {scale_mm} mm/px ± {percent}%, measured",
    scale_mm=Number(5),
    percent=Number(1),
)
SUMMARY_USUAL = define(
    "calibration.summary_usual",
    "{calibration}: {scale_mm} mm/px ± {percent}%, usual",
    scale_mm=Number(5),
    percent=Number(1),
)
IN_USE = define("calibration.in_use", "{summary}, in use {scale_mm} mm/px", summary=Nested())
NONE = define("calibration.none", "none: {scale_mm} mm/px, by the configuration")
NONE_ALLOWED = define(
    "calibration.none_allowed",
    "none: {scale_mm} mm/px, by the configuration; inspecting is allowed by service.uncalibrated",
)
RATIO_OF_BALL = define(
    "calibration.ratio_of_ball", "the ball's area is {percent}% of the calibration's", percent=Number(1)
)
REQUIRED = define(
    "calibration.required",
    "The sensor is not calibrated: calibrate it with the ball on the page Maintenance in manual mode, or by `station "
    "calibrate` with the station stopped.",
)
GEL_CHANGED = define(
    "calibration.gel_changed",
    "The sensor's gel was changed ({at}, {operator}): calibrate it with the ball on the page Maintenance in manual "
    "mode, or by `station calibrate` with the station stopped.",
)
NEVER_VERIFIED = define(
    "calibration.never_verified",
    "The calibration was never verified, and verification is required: verify it with the ball {how}",
    how=Nested(),
)
VERIFICATION_FAILED = define(
    "calibration.verification_failed",
    "The last verification failed: repair what its page names, then verify again {how}",
    how=Nested(),
)
VERIFICATION_OLD = define(
    "calibration.verification_old",
    "The last verification is {age_h} h old, at most {limit_h} h are allowed: verify with the ball {how}",
    age_h=Number(1),
    how=Nested(),
)
HOW_TO_VERIFY = define(
    "calibration.how_to_verify",
    "on the page Maintenance in manual mode, or by `station verify` with the station stopped.",
)
MISSING = define("calibration.missing", "the sensor is not calibrated: calibrate it first")
OLD = define(
    "calibration.old", "the calibration is {age_days} days old, at most {limit_days} are allowed", age_days=Number(0)
)
CHECKS_FAILED = define(
    "calibration.checks_failed",
    "the last verification, {verification}, failed: {checks}",
    checks=Listed(),
)

# A run at the panel.
NO_SENSOR = define("calibration.no_sensor", "This camera is no sensor that could be calibrated.")
LAY_BALL = define(
    "calibration.lay_ball",
    "Lay the ball {right_mm} mm to the right and {down_mm} mm down, as the image shows it, of its first place, and "
    "take your hands away.",
)
NOT_WAITING = define("calibration.not_waiting", "nothing waits for the ball at this moment; look at the run again")
NOT_BEGUN = define("calibration.not_begun", "nothing was begun with the ball; begin it first")
CALLED_OFF = define("calibration.called_off", "aborted: nothing was stored")
BALL_LATE = define("calibration.ball_late", "nobody laid the ball within {limit_min} min; begin again")

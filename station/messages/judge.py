"""Messages of the judge: what an inspection showed, beside which limit, and why no further step was made."""

from station.messages.message import Listed, Nested, Number, define, define_plural

# What ended or spoilt the inspection from outside the measurement.
REFERENCE_BAD = define(
    "judge.reference_bad", "The reference images were not usable, so nothing could be compared with them."
)
IMAGE_STALE = define("judge.image_stale", "No image taken after the step came in time.")
LATE = define("judge.late", "The inspection did not end within its deadline.")
CALLED_OFF = define("judge.called_off", "The inspection was aborted.")
ARM_FAULT = define("judge.arm_fault", "The arm failed or was stopped during the inspection.")
GRIPPER_FAULT = define("judge.gripper_fault", "The gripper failed during the inspection.")
CAMERA_FAULT = define("judge.camera_fault", "The camera failed during the inspection.")
RECORDS_FAULT = define("judge.records_fault", "The records could not be written.")
STATION_LOST = define("judge.station_lost", "The station was restarted during the inspection.")
INTERNAL_FAULT = define("judge.internal_fault", "The station's own software failed; its log says where.")
NOTHING_TOUCHED = define(
    "judge.nothing_touched",
    "Nothing was touched: no fruit in the nest, or one narrower than the recipe expects.",
)
INTERRUPTED = define("judge.interrupted", "The inspection was interrupted. {why}", why=Nested())

# The fruit is not one of the recipe's, or its limits are not known.
WRONG_WIDTH = define(
    "judge.wrong_width",
    "The fruit is {width_mm} mm wide; {recipe} is meant for {smallest_mm} to {largest_mm} mm.",
    width_mm=Number(1),
)
TOUCHED_AT_FIRST = define(
    "judge.touched_at_first",
    "The fruit was touched in the first image already, at {width_mm} mm: it is wider than that, and how far it was "
    "closed upon is not known.",
    width_mm=Number(1),
)
NO_LENGTH = define("judge.no_length", "The PLC gave no length of the fruit, and its limits depend on the length.")
NO_CLASS = define("judge.no_class", "The PLC gave no size class of the fruit, and its limits depend on the class.")
LENGTH_UNEXPECTED = define(
    "judge.length_unexpected",
    "The PLC gave a length of {length_mm} mm; {recipe} is expected with {smallest_mm} to {largest_mm} mm.",
    length_mm=Number(1),
)
CLASS_UNLISTED = define("judge.class_unlisted", "The PLC gave the size class {number}, which the recipe does not list.")
SIZE_CONTRADICTS = define(
    "judge.size_contradicts",
    "The PLC gave a length of {length_mm} mm and the size class {number}, which is for {smallest_mm} to "
    "{largest_mm} mm: they contradict each other.",
    length_mm=Number(1),
)
LENGTH_OF_ANOTHER = define(
    "judge.length_of_another",
    "The PLC gave a length of {length_mm} mm, and the fruit is {width_mm} mm wide: that is another fruit's size.",
    length_mm=Number(1),
    width_mm=Number(1),
)
CLASS_OF_ANOTHER = define(
    "judge.class_of_another",
    "The PLC gave the size class {number}, and the fruit is {width_mm} mm wide: that is another fruit's size.",
    width_mm=Number(1),
)

# Areas and growth beside their limits.
LIMIT = define("judge.limit", "the limit is {limit_mm2} mm²", limit_mm2=Number(1))
LIMIT_OF_LENGTH = define(
    "judge.limit_of_length",
    "the limit for {fruit} of {length_mm} mm is {limit_mm2} mm²",
    length_mm=Number(1),
    limit_mm2=Number(1),
)
LIMIT_WITHOUT_SIZE = define(
    "judge.limit_without_size", "the limit for a fruit of unknown size is {limit_mm2} mm²", limit_mm2=Number(1)
)
AREA_AND_LIMIT = define(
    "judge.area_and_limit",
    "The area at {closing_mm} mm of closing is {area_mm2} ± {uncertainty_mm2} mm²; {limit}.",
    area_mm2=Number(1),
    uncertainty_mm2=Number(1),
    limit=Nested(),
)
AREA_OVER = define(
    "judge.area_over",
    "The area at {closing_mm} mm of closing is at least {area_mm2} mm²; {limit}: it is over the limit.",
    area_mm2=Number(1),
    limit=Nested(),
)
AREA_NEAR = define(
    "judge.area_near",
    "The area at {closing_mm} mm of closing is {area_mm2} ± {uncertainty_mm2} mm²; {limit}: it is not surely within "
    "the limit.",
    area_mm2=Number(1),
    uncertainty_mm2=Number(1),
    limit=Nested(),
)
AREA_SMALL = define(
    "judge.area_small",
    "The area at {closing_mm} mm of closing is {area_mm2} ± {uncertainty_mm2} mm², which may be less than any fruit's, "
    "{least_mm2} mm²: not all of the contact was seen.",
    area_mm2=Number(1),
    uncertainty_mm2=Number(1),
    least_mm2=Number(1),
)
AREA_UNKNOWN = define("judge.area_unknown", "The area at {closing_mm} mm is unknown.")
GROWTH_OVER = define(
    "judge.growth_over",
    "From {from_mm} to {to_mm} mm of closing the area grows by {growth} ± {uncertainty} mm² per mm, over the limit "
    "of {limit}.",
    from_mm=Number(1),
    to_mm=Number(1),
    growth=Number(1),
    uncertainty=Number(1),
    limit=Number(1),
)
GROWTH_NEAR = define(
    "judge.growth_near",
    "From {from_mm} to {to_mm} mm of closing the area grows by {growth} ± {uncertainty} mm² per mm, which may be over "
    "the limit of {limit}.",
    from_mm=Number(1),
    to_mm=Number(1),
    growth=Number(1),
    uncertainty=Number(1),
    limit=Number(1),
)

# Why a step's area is not trusted.
CLOSING = define("judge.closing", "{closing_mm}", closing_mm=Number(1))
POINT = define("judge.point", "{closing_mm} mm ({area_mm2} mm²)", closing_mm=Number(1), area_mm2=Number(1))
CONTACT_LOST = define("judge.contact_lost", "At {closings} mm of closing the contact was lost.", closings=Listed())
NO_EDGE = define(
    "judge.no_edge",
    "At {closings} mm of closing something bent the gel, but no edge of a contact was found.",
    closings=Listed(),
)
CUT_BY_BORDER = define(
    "judge.cut_by_border",
    "At {closings} mm of closing the image's border cuts the contact, so its area is only a lower bound.",
    closings=Listed(),
)
EDGE_LOST = define(
    "judge.edge_lost",
    "At {closings} mm of closing the edge was lost, so the contact is at least as large as its area.",
    closings=Listed(),
)
SATURATED = define(
    "judge.saturated",
    "At {closings} mm of closing much of the contact is at the end of the grey scale.",
    closings=Listed(),
)
LOW_CONFIDENCE = define(
    "judge.low_confidence",
    "At {closings} mm of closing the image supports the area too little: confidence {confidence}, at least {least} is "
    "needed.",
    closings=Listed(),
    confidence=Number(2),
    least=Number(),
)
NO_CONFIDENCE = define(
    "judge.no_confidence",
    "At {closings} mm of closing the confidence is unknown; at least {least} is needed.",
    closings=Listed(),
    least=Number(),
)
REFERENCE_MISMATCH = define(
    "judge.reference_mismatch",
    "At {closings} mm of closing the image does not fit its reference.",
    closings=Listed(),
)
NOT_RISING = define_plural(
    "judge.not_rising",
    "The area does not rise with the closing: {points} does not fit the other steps.",
    "The area does not rise with the closing: {points} do not fit the other steps.",
    "number",
    points=Listed(),
)
LATE_ONSET = define(
    "judge.late_onset",
    "The onset is doubtful: the area rises as if the contact had begun at {begins_mm} mm of closing; at most "
    "{allowed_mm} mm is allowed.",
    begins_mm=Number(1),
)
NO_ONSET = define("judge.no_onset", "The onset is doubtful: the area does not rise with the closing.")

# Why no further step was made.
STOPPED_AREA = define(
    "judge.stopped_area",
    "No further step was made at {closing_mm} mm of closing: the area, {area_mm2} mm², is over the early stop's "
    "{limit_mm2} mm².",
    closing_mm=Number(1),
    area_mm2=Number(1),
    limit_mm2=Number(1),
)
STOPPED_GROWTH = define(
    "judge.stopped_growth",
    "No further step was made at {closing_mm} mm of closing: the area grows by {growth} mm² per mm, over the early "
    "stop's {limit}.",
    closing_mm=Number(1),
    growth=Number(1),
    limit=Number(1),
)
STOPPED_CLOSING = define(
    "judge.stopped_closing",
    "No further step was made at {closing_mm} mm of closing: that is the recipe's closing limit of {limit_mm} mm.",
    closing_mm=Number(1),
)
STOPPED_UNTRUSTED = define(
    "judge.stopped_untrusted",
    "No further step was made at {closing_mm} mm of closing: what was measured by then cannot be trusted, so the "
    "fruit cannot pass any more.",
    closing_mm=Number(1),
)
STOPPED_VOID = define(
    "judge.stopped_void",
    "No further step was made at {closing_mm} mm of closing: this cannot become a result any more.",
    closing_mm=Number(1),
)
STOPPED_DAMAGED = define(
    "judge.stopped_damaged",
    "No further step was made at {closing_mm} mm of closing: the fruit is damaged.",
    closing_mm=Number(1),
)
STOPPED_KEPT = define(
    "judge.stopped_kept",
    "No further step was made at {closing_mm} mm of closing: every limit is kept.",
    closing_mm=Number(1),
)
STOPPED_CANNOT_PASS = define(
    "judge.stopped_cannot_pass",
    "No further step was made at {closing_mm} mm of closing: the fruit cannot pass any more.",
    closing_mm=Number(1),
)
STEPS_ENDED = define(
    "judge.steps_ended",
    "The steps ended at {reached_mm} mm of closing, before {wanted_mm} mm, and nothing says why.",
    reached_mm=Number(1),
)

"""Messages of the published reasons: a sentence for each code, `reason.<code>`."""

from station.messages.message import Message, define, definition, verbatim

AREA_OVER_LIMIT = define(
    "reason.area_over_limit",
    "The contact area is over the recipe's limit at one of its closings, also with its uncertainty taken off.",
)
GROWTH_OVER_LIMIT = define("reason.growth_over_limit", "The contact area grew faster than the recipe's limit.")
EARLY_STOP = define(
    "reason.early_stop", "The steps ended early to spare the fruit: the recipe's early stop limit was passed."
)
NO_CONTACT = define("reason.no_contact", "The gripper closed without touching a fruit.")
CONTACT_LOST = define("reason.contact_lost", "The contact was lost while the gripper closed.")
AREA_NOT_RISING = define(
    "reason.area_not_rising", "The contact area did not rise with the closing, so it cannot be trusted."
)
CUT_BY_BORDER = define(
    "reason.cut_by_border", "The contact reached beyond the image, so its area is only a lower bound."
)
SATURATED = define("reason.saturated", "The image was saturated.")
LOW_CONFIDENCE = define("reason.low_confidence", "The contact was found with too little confidence.")
REFERENCE_BAD = define("reason.reference_bad", "No good reference image could be taken.")
IMAGE_STALE = define("reason.image_stale", "The camera gave no image that was new enough.")
OUT_OF_RANGE = define("reason.out_of_range", "The fruit's width is outside the recipe's range.")
LATE = define("reason.late", "The inspection was not done by its deadline.")
CALLED_OFF = define("reason.called_off", "The inspection was aborted.")
ARM_FAULT = define("reason.arm_fault", "The arm had a fault.")
GRIPPER_FAULT = define("reason.gripper_fault", "The gripper had a fault.")
CAMERA_FAULT = define("reason.camera_fault", "The camera had a fault.")
RECORDS_FAULT = define("reason.records_fault", "The records could not be written.")
STATION_LOST = define(
    "reason.station_lost", "The station failed or restarted before the PLC had certainly received the outcome."
)
INTERNAL_FAULT = define("reason.internal_fault", "The program had an internal fault; its log says where.")
NEAR_LIMIT = define(
    "reason.near_limit",
    "The contact area or its growth is too near a limit for the uncertainty of the measurement.",
)
SIZE_UNKNOWN = define("reason.size_unknown", "The recipe needs the fruit's size, and the PLC gave no valid one.")


def reason_message(code: str) -> Message:
    """Return the sentence of a reason as published to the PLC; the code itself if this version does not have it."""
    known = definition(f"reason.{code}")
    return verbatim(code) if known is None else known()

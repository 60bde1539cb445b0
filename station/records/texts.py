"""Texts of the records for people: curve, reason and fruit size as text."""

from collections.abc import Sequence

from station.channel.line import Reason
from station.inspection.fruit_size import FruitSize

_BARS = "▁▂▃▄▅▆▇█"

SENTENCES: dict[Reason, str] = {
    Reason.AREA_OVER_LIMIT: "the contact area was not safely below the recipe's limit at one of its closings",
    Reason.GROWTH_OVER_LIMIT: "the contact area grew faster than the recipe's limit",
    Reason.EARLY_STOP: "the steps ended early to spare the fruit: the recipe's early stop limit was passed",
    Reason.NO_CONTACT: "the gripper closed without touching a fruit",
    Reason.CONTACT_LOST: "the contact was lost while the gripper closed",
    Reason.AREA_NOT_RISING: "the contact area did not rise with the closing, so it cannot be trusted",
    Reason.CUT_BY_BORDER: "the contact reached beyond the image, so its area is only a lower bound",
    Reason.SATURATED: "the image was saturated",
    Reason.LOW_CONFIDENCE: "the contact was found with too little confidence",
    Reason.REFERENCE_BAD: "no good reference image could be taken",
    Reason.IMAGE_STALE: "the camera gave no image that was new enough",
    Reason.OUT_OF_RANGE: "the fruit's width is not one of the recipe's",
    Reason.LATE: "the inspection was not done by its deadline",
    Reason.CALLED_OFF: "the inspection was called off",
    Reason.ARM_FAULT: "the arm had a fault",
    Reason.GRIPPER_FAULT: "the gripper had a fault",
    Reason.CAMERA_FAULT: "the camera had a fault",
    Reason.RECORDS_FAULT: "the records could not be written",
    Reason.STATION_LOST: "the station was lost or restarted before the outcome was surely the PLC's",
    Reason.INTERNAL_FAULT: "the program had a fault of its own; see the log",
    Reason.NEAR_LIMIT: "the contact area or its growth is nearer to a limit than the measurement is certain",
    Reason.SIZE_UNKNOWN: "the recipe needs the fruit's size, and the PLC gave none that can be true",
}


def sparkline(values: Sequence[float | None]) -> str:
    """Draw a curve in one line of bars, from 0 to its largest value; a dot for a missing value.

    Args:
        values: as areas in mm², in the order of the steps.
    """
    largest = max((value for value in values if value is not None), default=0.0)
    return "".join("·" if value is None else _bar(value, largest) for value in values)


def sentence(reason: str) -> str:
    """Return a reason as a sentence, or unchanged if it is not one of the contract's."""
    return SENTENCES[Reason(reason)] if reason in set(Reason) else reason


def size_sentence(size: FruitSize) -> str:
    """Describe the fruit's size as the PLC gave it, or that it gave none."""
    length = [] if size.length_mm is None else [f"fruit length {size.length_mm:.1f} mm"]
    named = [] if size.size_class is None else [f"class {size.size_class}"]
    given = ", ".join([*length, *named])
    return f"{given} (given by the PLC)" if given else "not given by the PLC"


def printable(text: str) -> str:
    """Replace characters that would control a terminal: a lot's name comes from outside."""
    return "".join(letter if letter.isprintable() or letter == "\n" else "\N{REPLACEMENT CHARACTER}" for letter in text)


def _bar(value: float, largest: float) -> str:
    share = max(0.0, value) / largest if largest > 0 else 0.0
    return _BARS[min(len(_BARS) - 1, int(share * len(_BARS)))]

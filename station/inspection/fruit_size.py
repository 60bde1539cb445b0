"""The fruit's size as a grader upstream measured it and the line's PLC passed it on with the trigger."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class FruitSize:
    """Size of a fruit as the PLC wrote it; unchecked, because only a recipe knows the possible values."""

    length_mm: float | None = None
    """Length from stem to tip, mm; None where the PLC gave none (register 0)."""
    size_class: int | None = None
    """The grader's size class, 1 to 65535; None where the PLC gave none (register 0)."""


NO_SIZE = FruitSize()
"""Size of a fruit for which the PLC gave none."""

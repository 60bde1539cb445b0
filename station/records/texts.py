"""Texts of the records for people: curve and fruit size as text."""

from collections.abc import Sequence

from station.inspection.fruit_size import FruitSize

_BARS = "▁▂▃▄▅▆▇█"


def sparkline(values: Sequence[float | None]) -> str:
    """Draw a curve, as areas by step, in one line of bars, from 0 to its largest value; a dot for a missing value."""
    largest = max((value for value in values if value is not None), default=0.0)
    return "".join("·" if value is None else _bar(value, largest) for value in values)


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

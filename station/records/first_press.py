"""First press of a fruit that was pressed twice; the record's curve is that of the last press."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from station.inspection.judge import Judgement
from station.inspection.press import Measured, Press
from station.messages.message import Message, joined
from station.vocabulary import Flag

_PRESSES, _PRESS = "presses", "first_press"
_FLAGS = {flag.value for flag in Flag}


def first_press_measures(earlier: Sequence[Press]) -> dict[str, int | str]:
    """Return the record's measurements of an inconclusive press before the last one; nothing if there was none."""
    if not earlier:
        return {}
    first = earlier[0]
    points = [
        [point.closing_mm, point.area_mm2, point.area_px, point.confidence, " ".join(sorted(point.flags))]
        for point in first.points
    ]
    stored = json.dumps([first.onset_mm, first.onset_uncertainty_mm, points], separators=(",", ":"))
    return {_PRESSES: 1 + len(earlier), _PRESS: stored}


def first_press(measures: Mapping[str, Any]) -> Press | None:
    """Return the measurements of the first press, without what both share; None if the fruit was pressed once."""
    if _PRESS not in measures:
        return None
    onset_mm, uncertainty_mm, points = json.loads(measures[_PRESS])
    measured = tuple(
        Measured(closing_mm, area_mm2, area_px, confidence, frozenset(Flag(f) for f in flags.split() if f in _FLAGS))
        for closing_mm, area_mm2, area_px, confidence, flags in points
    )
    return Press(onset_mm, uncertainty_mm, measured)


def first_press_findings(verdict: Judgement | None) -> Message | None:
    """Return why the first press did not decide, by the verdict on it; None if the fruit was pressed once."""
    found = [finding.message for finding in verdict.findings] if verdict is not None else []
    return joined(found) if found else None


def is_first_press(measure: str) -> bool:
    """Check whether a measure is the first press's curve, which no list shows."""
    return measure == _PRESS

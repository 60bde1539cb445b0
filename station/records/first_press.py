"""First press of a fruit that was pressed twice; the record's curve is that of the last press."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from station.inspection.judge import Verdict
from station.inspection.press import Flag, Measured, Press

_PRESSES, _FINDINGS, _PRESS = "presses", "first_press_findings", "first_press"
_FLAGS = {flag.value for flag in Flag}


def first_press_measures(earlier: Sequence[Press], verdict: Verdict | None) -> dict[str, int | str]:
    """Return what the record stores of an inconclusive press; nothing if there was none.

    Args:
        earlier: the presses before the last one.
    """
    if not earlier or verdict is None:
        return {}
    first = earlier[0]
    points = [
        [point.closing_mm, point.area_mm2, point.area_px, point.confidence, " ".join(sorted(point.flags))]
        for point in first.points
    ]
    stored = json.dumps([first.onset_mm, first.onset_uncertainty_mm, points], separators=(",", ":"))
    why = " ".join(finding.sentence for finding in verdict.findings)
    return {_PRESSES: 1 + len(earlier), _FINDINGS: why, _PRESS: stored}


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


def first_press_findings(measures: Mapping[str, Any]) -> str:
    """Return why the first press did not decide, in sentences; empty if the fruit was pressed once."""
    return str(measures.get(_FINDINGS) or "")


def is_first_press(measure: str) -> bool:
    """Check whether a measure is the first press's, and has a line of its own."""
    return measure in {_FINDINGS, _PRESS}

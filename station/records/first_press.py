"""The first press in an inspection's record, where the fruit was pressed twice: the curve is that of the last press."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from station.inspection.judge import Verdict
from station.inspection.press import Flag, Measured, Press

_PRESSES, _FINDINGS, _PRESS = "presses", "first_press_findings", "first_press"
_FLAGS = {flag.value for flag in Flag}


def first_press_measures(earlier: Sequence[Press], verdict: Verdict | None) -> dict[str, int | str]:
    """What is kept of a press that was inconclusive; nothing where there was none.

    Args:
        earlier: the presses before the last one.
        verdict: on the first.
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
    """The first press as it was measured, without what is the same for both; None where the fruit was pressed once.

    Args:
        measures: an inspection's.
    """
    if _PRESS not in measures:
        return None
    onset_mm, uncertainty_mm, points = json.loads(measures[_PRESS])
    measured = tuple(
        Measured(closing_mm, area_mm2, area_px, confidence, frozenset(Flag(f) for f in flags.split() if f in _FLAGS))
        for closing_mm, area_mm2, area_px, confidence, flags in points
    )
    return Press(onset_mm, uncertainty_mm, measured)


def first_press_findings(measures: Mapping[str, Any]) -> str:
    """Why the first press did not decide, in sentences; empty where the fruit was pressed once.

    Args:
        measures: an inspection's.
    """
    return str(measures.get(_FINDINGS) or "")


def is_first_press(measure: str) -> bool:
    """Whether a measure is the first press's, and has a line of its own.

    Args:
        measure: its name.
    """
    return measure in {_FINDINGS, _PRESS}

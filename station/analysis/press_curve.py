"""Area curve of each press among the images of an analysis."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from station.analysis.report import ReportRow
from station.inspection.curve import AreaCurve, Reading, area_curve
from station.inspection.monotone import WrongFrame, wrong_frames


class Step(NamedTuple):
    """One image of a press, with a known area."""

    row: ReportRow
    reading: Reading


@dataclass(frozen=True, slots=True)
class PressCurve:
    """Area curve of one press, with its own onset."""

    number: int
    """Of the press, from 1, in the order of the images given."""
    rows: Sequence[ReportRow]
    """Of the images, one a point; empty where the press has no onset, and so no points."""
    curve: AreaCurve
    wrong: Sequence[WrongFrame]
    """The points that do not fit the others of the press."""


def press_curve(number: int, steps: Sequence[Step]) -> PressCurve:
    """Make the curve of a press from its steps, in the order of falling width."""
    curve = area_curve(step.reading for step in steps)
    readings = [point.reading for point in curve.points]
    wrong = wrong_frames([reading.width_mm for reading in readings], [reading.area_mm2 for reading in readings])
    return PressCurve(number, [step.row for step in steps] if curve.points else [], curve, wrong)

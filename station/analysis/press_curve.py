"""Area curve of each press among the images of an analysis."""

from collections.abc import Iterable, Sequence
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


def press_curve(number: int, steps: Iterable[Step]) -> PressCurve:
    """Make the curve of a press from its steps, in the order of measuring."""
    ordered = sorted(steps, key=lambda step: -step.reading.width_mm)  # as the curve's points: a read width may jitter
    curve = area_curve(step.reading for step in ordered)
    readings = [point.reading for point in curve.points]
    wrong = wrong_frames([reading.width_mm for reading in readings], [reading.area_mm2 for reading in readings])
    return PressCurve(number, [step.row for step in ordered] if curve.points else [], curve, wrong)

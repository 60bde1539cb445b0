"""Gauge study on the twin: its design, and its report."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from station.settings.recipe import find_recipe
from station.studies.gauge import analyse
from station.studies.gauge_dummies import (
    DUMMY_TRUTHS,
    LARGEST_MM,
    PLAY_MM,
    SMALLEST_MM,
    STOP_MM,
    measure_dummy,
    stop_mm,
)
from station.studies.gauge_grip import last_limit_mm
from station.studies.gauge_twin import PART_TRUTHS, GaugeTask, Simulated, good_and_damaged_mm2, measure_part
from station.studies.grr import GaugeStudy, Origin, analysed
from station.studies.workers import on_this_machine

_MEASURED = "and the sensor, its light and the method: as measured"


@dataclass(frozen=True, slots=True)
class TwinDesign:
    """Design of a gauge study on the twin."""

    fruit: str
    parts: int
    operators: int
    repeats: int
    seed: int
    jobs: int
    dummies: bool = False
    """Balls in a jig instead of the fruit, with the fruit's recipe and tolerance."""

    @property
    def tasks(self) -> list[GaugeTask]:
        """Return all measurements, in the order of the table."""
        return [
            GaugeTask(self.fruit, self.seed, part, operator, repeat)
            for part in range(self.parts)
            for operator in range(self.operators)
            for repeat in range(self.repeats)
        ]


def study_on_twin(design: TwinDesign, tolerance: float | None, on_done: Callable[[], None]) -> GaugeStudy:
    """Carry out all measurements and analyse them; the result is the same for any number of processes.

    Args:
        tolerance: in mm²; None: the difference of true areas between good and damaged fruit.
        on_done: called after each measurement.

    Raises:
        StationError: a process was killed from outside.
    """
    made = _measured(design, on_done)
    if tolerance is not None:
        words = f"{tolerance:g} mm²"
    else:
        good, damaged = good_and_damaged_mm2(design.fruit, design.seed)
        tolerance = damaged - good
        words = (
            f"{tolerance:.1f} mm²: bruised fruit have {damaged:.1f} mm² at the last limit's closing, the same ones "
            f"sound {good:.1f} mm² (true areas, mean of 30)"
        )
    facts = [*(_dummy_facts(design, made) if design.dummies else _fruit_facts(design)), ("Tolerance", words)]
    title = "firm balls" if design.dummies else design.fruit
    study = analysed(f"{title} on the twin", facts, [one.measurement for one in made], tolerance)
    truths = np.array([one.truths_mm2 for one in made]).reshape(*study.table.areas_mm2.shape, -1)
    names = DUMMY_TRUTHS if design.dummies else PART_TRUTHS
    origins = [Origin(name, analyse(truths[..., place], tolerance)) for place, name in enumerate(names)]
    return replace(study, origins=(*origins, Origin(_MEASURED, study.gauge)))


def _measured(design: TwinDesign, on_done: Callable[[], None]) -> list[Simulated]:
    work = partial(measure_dummy, parts=design.parts) if design.dummies else measure_part
    found: dict[tuple[str, ...], Simulated] = {}
    for one in on_this_machine(work, design.tasks, design.jobs):
        found[one.measurement[:3]] = one
        on_done()
    # In the table's order: processes finish in any.
    return [found[task.names] for task in design.tasks]


def _fruit_facts(design: TwinDesign) -> list[tuple[str, str]]:
    closing_mm = last_limit_mm(find_recipe(design.fruit))
    return [
        ("Parts", f"{design.parts} fruit of the twin: {design.fruit}, every second one bruised, seed {design.seed}"),
        ("Operators", f"{design.operators}: another sensor unit, gripper zero and habit each; fruit placed again"),
        ("Repeats", f"{design.repeats}: gripped without moving it, with the sensor's noise as measured on real ones"),
        ("Measured", f"the area that the station judges, at {closing_mm:g} mm of closing, by the shipped recipe"),
    ]


def _dummy_facts(design: TwinDesign, made: Sequence[Simulated]) -> list[tuple[str, str]]:
    refused, areas_mm2 = sum(one.refused for one in made), [one.measurement.area_mm2 for one in made]
    spread = f"{min(areas_mm2):.0f} to {max(areas_mm2):.0f} mm²"
    balls = f"{design.parts} firm balls of {SMALLEST_MM:g} to {LARGEST_MM:g} mm in a jig"
    laid_in = f"taken out and placed again ({PLAY_MM:g} mm of play, {STOP_MM:g} mm at the stop, standard deviations)"
    return [
        ("Parts", f"{balls}, each pressed by {stop_mm(design.fruit):g} mm, to a stop; seed {design.seed}"),
        ("Operators", f"{design.operators}: another sensor unit each"),
        ("Repeats", f"{design.repeats}: {laid_in}, with the sensor's noise as measured on real ones"),
        ("Measured", f"the area of one step, {spread}, by the shipped recipe of {design.fruit}"),
        ("Refused", f"{refused} of {len(made) + refused} readings: flagged by the method itself, and made again"),
    ]

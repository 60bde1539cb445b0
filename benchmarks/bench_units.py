"""Units over the whole range of scales, each calibrated by the station's own procedure, then sorting fruit.

The scale and the uncertainty that the calibration states are what the judge gets. The same presses are judged by a
scale with a drawn error too, as `./run bench sorting` has it, whose cache this run shares. About a quarter of an hour
on one core; it can be interrupted and resumed. Writes two tables into `docs/sorting.md`.
"""

import asyncio
import sys
from collections.abc import Sequence
from statistics import fmean, pstdev

import cv2
from bench_sorting import CACHE, DOCUMENT, decided
from sections import write
from sorting import tables
from sorting.cycle import Found, Practice
from sorting.presses import PressCache
from sorting.specimens import KINDS, ON_UNITS, SOUND, UNITS, SensorUnit, Task, sensor_unit

from station.calibration.calibration_procedure import CalibrationProcedure
from station.calibration.errors import RefusedError
from station.calibration.rig import Unit
from station.commands.simulated_unit import PLACES
from station.settings.calibration import CalibrationSettings
from station.settings.recipe import find_recipe
from station.studies.simulated_rig import SimulatedRig
from station.twin.damage import Severity

SPILL_MM = 0.02
"""Standard deviation of where a person puts the ball, as in `bench_calibration`."""
OF_EACH_UNIT = {SOUND: 3, Severity.SEVERE: 1, Severity.MILD: 2}
"""Fruit of each kind that a unit presses."""


def calibrate(unit: SensorUnit) -> tuple[Found, int]:
    """Calibrate one unit, again where it is refused as a person would.

    Args:
        unit: with its true scale.

    Returns:
        What was found, and how often it was refused before.
    """
    refused = 0
    while True:
        ball = SimulatedRig(unit.light + 100 * refused, unit=unit.light, mm_per_px=unit.mm_per_px, spill_mm=SPILL_MM)
        procedure = CalibrationProcedure(
            ball,
            Unit(f"D{unit.light}", "drawn DIGIT", simulated=True),
            find_recipe("rubber_ball"),
            CalibrationSettings(),
            PLACES,
            "bench",
            "0",
            lambda _: None,
        )
        try:
            found = asyncio.run(procedure.run()).calibration
        except RefusedError:
            refused += 1
            continue
        # Stated is about two standard deviations; the station halves it likewise.
        return Found(unit.light, found.mm_per_px, found.scale_uncertainty / 2), refused


def accuracy(units: Sequence[SensorUnit], found: Sequence[Found], refused: int) -> list[str]:
    """Return a table of the found scales' errors, beside the uncertainties that the calibrations state.

    Args:
        units: with the true scales.
        found: the calibration of each unit.
        refused: calibrations that had to be repeated.
    """
    errors = [one.mm_per_px / unit.mm_per_px - 1 for unit, one in zip(units, found, strict=True)]
    stated = [2 * one.standard_uncertainty for one in found]
    beyond = sum(abs(error) > most for error, most in zip(errors, stated, strict=True))
    cells = (
        len(units),
        f"{units[0].mm_per_px:.4f} to {units[-1].mm_per_px:.4f}",
        refused,
        f"{fmean(errors):+.1%}",
        f"{pstdev(errors):.1%}",
        f"{max(errors, key=abs):+.1%}",
        f"{min(stated):.1%} to {max(stated):.1%}",
        beyond,
    )
    names = ("units", "true mm/px", "refused", "error, mean", "standard deviation", "furthest", "stated ±", "beyond it")
    return [*tables.header(*names), tables.row(*cells)]


def main() -> None:
    """Calibrate, inspect, write."""
    cv2.setNumThreads(1)
    units = [sensor_unit(number) for number in range(UNITS)]
    found: list[Found] = []
    refused = 0
    for unit in units:
        one, times = calibrate(unit)
        found.append(one)
        refused += times
        print(f"\rcalibrated {len(found)} of {UNITS}", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    tasks = [
        Task(kind, str(group), ON_UNITS, number)
        for kind in KINDS
        for group, count in OF_EACH_UNIT.items()
        for number in range(count * UNITS)
    ]
    practices = {
        "scale of its unit's calibration": Practice(calibrations=tuple(found)),
        "scale with a drawn error, ± 2.2 %": Practice(),
    }
    cache = PressCache(CACHE, processes=1)
    inspected = decided(tasks, {kind: find_recipe(kind) for kind in KINDS}, practices.values(), cache)
    sections = {
        "calibrations": accuracy(units, found, refused),
        "units": tables.worth({name: inspected[practice] for name, practice in practices.items()}),
    }
    for lines in sections.values():
        print("\n".join(lines), end="\n\n")
    write(DOCUMENT, sections)


if __name__ == "__main__":
    main()

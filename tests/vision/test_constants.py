"""Every constant of the robust method states its unit, grid, meaning and origin, and is used."""

import os
import subprocess
import sys
from dataclasses import fields, replace
from pathlib import Path

import pytest

import station.vision
from benchmarks.fit.fixed import fixed_numbers, table
from station.vision.constants import CONSTANTS, Constants

ROOT = Path(__file__).resolve().parents[2]
SOURCES = {
    path.name: path.read_text()
    for folder in station.vision.__path__
    for path in Path(folder).glob("*.py")
    if path.name != "constants.py"
}
ORIGINS = ("fit", "measured")


@pytest.mark.parametrize("one", fields(Constants), ids=lambda one: one.name)
def test_a_constant_states_unit_meaning_and_origin(one):
    assert set(one.metadata) == {"unit", "grid", "meaning", "origin"}
    assert one.metadata["meaning"]
    assert one.metadata["origin"].startswith(ORIGINS)
    assert one.metadata["grid"] in {"working", "half", ""}
    assert (one.metadata["unit"] == "px") == bool(one.metadata["grid"])
    assert isinstance(one.default, int | float)


@pytest.mark.parametrize("name", [one.name for one in fields(Constants)])
def test_a_constant_is_used(name):
    assert any(f".{name}" in source for source in SOURCES.values())


def test_constants_are_changed_by_making_others():
    changed = replace(CONSTANTS, known_share=0.3)
    assert changed.known_share == 0.3
    assert CONSTANTS.known_share != 0.3


def test_every_other_number_says_what_it_is():
    numbers = list(fixed_numbers())
    assert [f"{one.file}: {', '.join(one.names)}" for one in numbers if not one.meaning] == []
    assert len(numbers) > 50


def test_the_document_has_every_other_number():
    page = (Path(__file__).resolve().parents[2] / "docs" / "robust-constants.md").read_text(encoding="utf-8")
    missing = [line for line in table() if line not in page]
    assert missing == [], "renew the page: ./run bench fit --evaluate"


PRINT_SEEDS = """
from fit.parts import SEEDS
from fit.reference import TWIN_PAIRS
from fit.reliability import FIRST_SEEDS
from measurement import at_the_border, light_touch, on_the_twin, references, soft_table, untouched

print(*(seed for part in SEEDS.values() for name, seed in part.items() if name != "noise"), TWIN_PAIRS.start)
print(*on_the_twin.TWIN_SEEDS, *on_the_twin.BRUISED_SEEDS, *FIRST_SEEDS.values(), at_the_border.BORDER_SEED)
print(soft_table.SEEDS.start, references.TWIN_SEEDS.start, untouched.UNITS.start, light_touch.DETECTION_SEED)
"""


def test_what_the_measurement_is_judged_on_shares_no_seed_with_the_fit():
    """A set takes the seeds after its first one: by the thousand, which none exceeds."""
    paths = os.pathsep.join([str(ROOT), str(ROOT / "benchmarks")])
    done = subprocess.run(
        [sys.executable, "-c", PRINT_SEEDS], env={**os.environ, "PYTHONPATH": paths}, check=True, capture_output=True
    )
    fitted, *judged = ({int(seed) // 1000 for seed in line.split()} for line in done.stdout.splitlines())
    assert len(fitted) == 17
    assert len(set().union(*judged)) == 10
    assert fitted.isdisjoint(set().union(*judged))

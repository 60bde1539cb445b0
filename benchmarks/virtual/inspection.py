"""One inspection of the simulated station, and the fruit that it measures."""

import random
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

from station.inspection.judge import Judgement, early_stop, judge
from station.inspection.press import Measured, Press
from station.inspection.second_press import together
from station.settings.recipe import load_recipes
from station.vocabulary import Flag, OutcomeName, Reason

RECIPE = load_recipes()["strawberry"]
SOUND, DAMAGED = (26.0, 28.0, 30.0), (45.0, 75.0, 95.0)
"""Growth of the contact area with the closing, mm² per mm: those that pass by the recipe, and those that do not.

Few, so that presses repeat and are judged from a cache."""
_WIDTHS_MM = (28.0, 35.0, 42.0)
_PX_MM2 = 1400.0
DAMAGED_SHARE, NONE_SHARE, OFF_MIDDLE_SHARE = 0.2, 0.02, 0.1


class Fruit(NamedTuple):
    """A fruit in the nest."""

    number: int
    width_mm: float
    mm2_per_mm: float
    """0 for an empty nest."""
    off_middle: bool


def draw_fruit(number: int, rng: random.Random) -> Fruit:
    """Draw a fruit: sound, damaged, or none at all."""
    place = rng.random()
    kinds = DAMAGED if place < DAMAGED_SHARE else SOUND
    growth = 0.0 if place > 1 - NONE_SHARE else rng.choice(kinds)
    return Fruit(number, rng.choice(_WIDTHS_MM), growth, rng.random() < OFF_MIDDLE_SHARE)


@dataclass(slots=True)
class Inspection:
    """From the trigger to the outcome."""

    sequence: int = 0
    accepted_s: float = 0.0
    captured: list[Measured] = field(default_factory=list)
    """In order; measured as they are taken, and seen later."""
    seen: int = 0
    closed_steps: int = 0
    closings: int = 0
    onset_mm: float | None = None
    earlier: list[Press] = field(default_factory=list)
    interruptions: list[Reason] = field(default_factory=list)
    verdict: Judgement | None = None
    outcome: OutcomeName = "NO_RESULT"
    fruits: set[int] = field(default_factory=set)
    standing: bool = False

    def press(self) -> Press:
        """Return all presses together as one, with what was seen so far."""
        latest = Press(
            self.onset_mm, 0.4, tuple(self.captured[: self.seen]), tuple(self.interruptions), resolution_mm=0.4
        )
        return together([*self.earlier, latest])

    def let_go(self) -> None:
        """Begin another closing."""
        self.captured.clear()
        self.seen = self.closed_steps = 0
        self.onset_mm = None


def point(fruit: Fruit | None, closing_mm: float, trouble: str | None, rng: random.Random) -> Measured:
    """Measure a fruit at a closing, by a camera with a trouble."""
    growth = 0.0 if fruit is None else fruit.mm2_per_mm
    area_mm2 = growth * max(closing_mm, 0.2)
    if trouble == "garbage":
        area_mm2 = float(rng.choice((0.0, 40.0, 200.0)))
        return Measured(
            closing_mm, area_mm2, int(_PX_MM2 * area_mm2), rng.choice((None, 0.1)), frozenset({Flag.UNDECIDED})
        )
    if trouble == "wrong":
        area_mm2 *= rng.choice((0.2, 0.6, 2.5))
    flags = frozenset({Flag.NO_CONTACT}) if area_mm2 == 0 else frozenset[Flag]()
    return Measured(closing_mm, area_mm2, int(_PX_MM2 * area_mm2), 0.9, flags)


@lru_cache(maxsize=100_000)
def ends_steps(press: Press) -> bool:
    """Return whether the judge allows no further step."""
    return early_stop(press, RECIPE) is not None


@lru_cache(maxsize=100_000)
def judged(press: Press) -> Judgement:
    """The judge's own judgement, once for each different press."""
    return judge(press, RECIPE)

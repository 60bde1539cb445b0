"""Closings on the sorting run's fruit, imaged and measured as the station does it, and kept for any recipe's judge."""

import hashlib
import pickle
import sys
import time
from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import cv2

import station
from station.press.stop import steps_to_decide
from station.settings.recipe import find_recipe
from station.settings.recipe_model import Recipe
from station.studies.gauge_grip import FruitRig, Grip
from station.studies.workers import on_this_machine
from station.twin.gel import SENSOR_SHAPE, Gel
from station.twin.squeeze import Squeeze
from station.vision.contact import Contact

from .specimens import SOUND, Task, draw
from .sweep import close_on_the_way

_DEEPEST_MM = 5.0
"""Two steps beyond the last threshold, where every fruit is decided."""
_EARLY_STOP_MM = 6.1
"""Where the early stops of sound fruit lie."""
PRESSED_ON = 100
"""The first closing of so many sound fruit goes on to the early stop, to compare the forces."""
_KEEP_EVERY_S = 20.0
_DECIDED_BY = (
    "vision",
    "press",
    "studies/gauge_grip.py",
    "studies/simulated_rig.py",
    "settings/gripper.py",
    *(
        f"twin/{name}"
        for name in ("contact.py", "damage.py", "fruit.py", "gel.py", "squeeze.py", "texture.py", "digit")
    ),
)
"""Below the package: the code that decides what a closing measures."""


class Closing(NamedTuple):
    """One closing on a fruit."""

    task: Task
    number: int
    """How many closings on the same fruit came before."""
    shift_mm: tuple[float, float]
    """By how much the arm has moved since the fruit was laid in, as the contact's way in the image."""


class Step(NamedTuple):
    """One measured width step, in pixels: the scale belongs to whoever judges."""

    closing_mm: float
    area_px: int
    confidence: float | None
    flags: tuple[str, ...]
    offset_px: tuple[float, float] | None
    """From the field's middle to the contact's, x to the right and y down; None without a contact."""
    force_n: float
    """The true one, before the flesh creeps."""
    on_the_way: bool = False
    """Measured while the jaws closed on."""


class Pressed(NamedTuple):
    """Measurements of one closing; no steps where nothing was touched."""

    onset_mm: float | None
    """As the gripper reads it."""
    onset_uncertainty_mm: float
    steps: tuple[Step, ...]


def press(closing: Closing, recipes: Path | None = None) -> tuple[Closing, Pressed]:
    """Image and measure one closing.

    Args:
        closing: which.
        recipes: the recipes' folder; None for the shipped ones.
    """
    cv2.setNumThreads(1)
    one, recipe = draw(closing.task), find_recipe(closing.task.kind, recipes)
    x_mm, y_mm = closing.shift_mm
    pose = replace(one.pose, x_px=one.pose.x_px + x_mm / one.mm_per_px, y_px=one.pose.y_px + y_mm / one.mm_per_px)
    noise_seed = one.noise_seed + closing.number
    rig = FruitRig(one.fruit, pose, one.unit, noise_seed, one.mm_per_px)
    grip = Grip(recipe, rig)
    onset = grip.approach(one.phase)
    if onset is None:
        return closing, Pressed(None, 0.0, ())
    squeeze = Squeeze(one.fruit, Gel(mm_per_px=one.mm_per_px))
    middle_x, middle_y = ((side - 1) / 2 for side in SENSOR_SHAPE[::-1])
    pressed_on = closing.number == 0 and closing.task.group == SOUND and closing.task.number < PRESSED_ON
    deepest_mm = _EARLY_STOP_MM if pressed_on else _DEEPEST_MM
    steps: list[Step] = []

    def seen(closing_mm: float, contact: Contact, *, on_the_way: bool) -> None:
        centre = contact.centroid_px
        steps.append(
            Step(
                closing_mm,
                contact.area_px,
                contact.confidence,
                tuple(sorted(flag.value for flag in contact.flags)),
                None if centre is None else (centre[0] - middle_x, centre[1] - middle_y),
                squeeze.at(one.fruit.width_mm - onset.width_mm + closing_mm).force_n,
                on_the_way,
            )
        )

    def passing(closing_mm: float, contact: Contact) -> None:
        seen(closing_mm, contact, on_the_way=True)

    def goes_on(closing_mm: float, contact: Contact) -> bool:
        if closing_mm > deepest_mm:
            return False
        seen(closing_mm, contact, on_the_way=False)
        return True

    if recipe.steps.measured == "while_closing":
        close_on_the_way(grip, rig, recipe, onset, noise_seed, passing, goes_on)
    else:
        grip.close(onset, goes_on)
    return closing, Pressed(onset.width_mm + one.zero_mm, onset.uncertainty_mm, tuple(steps))


class PressCache:
    """Measured closings in a folder; those that other code or another recipe's segmentation made are not read.

    Args:
        folder: where; made when needed.
        processes: that image at the same time.
        recipes: the recipes' folder; None for the shipped ones.
    """

    def __init__(self, folder: Path, processes: int, recipes: Path | None = None) -> None:
        self._folder, self._processes, self._recipes = folder, processes, recipes
        self._hashes: dict[str, str] = {}
        self._known: dict[Closing, Pressed] = {}
        self._read: set[Path] = set()

    def get(self, closing: Closing) -> Pressed | None:
        """A closing; None where it is not measured yet.

        Args:
            closing: which.
        """
        place = self._place(closing.task)
        if place not in self._read:
            self._read.add(place)
            if place.exists():
                self._known.update(pickle.loads(place.read_bytes()))
        return self._known.get(closing)

    def measure(self, wanted: Iterable[Closing]) -> None:
        """Image and measure closings, and keep them as they come.

        Args:
            wanted: which; those that are kept already are not made again.
        """
        missing = [closing for closing in dict.fromkeys(wanted) if self.get(closing) is None]
        work = partial(press, recipes=self._recipes)
        began = kept = time.monotonic()
        for done, (closing, pressed) in enumerate(on_this_machine(work, missing, self._processes), 1):
            self._known[closing] = pressed
            now = time.monotonic()
            if done == len(missing) or now - kept > _KEEP_EVERY_S:
                self._keep()
                kept = now
            print(f"\r{done} of {len(missing)} closings in {now - began:.0f} s", end="", file=sys.stderr, flush=True)
        if missing:
            print(file=sys.stderr)

    def _keep(self) -> None:
        by_place: dict[Path, dict[Closing, Pressed]] = {}
        for closing, pressed in self._known.items():
            by_place.setdefault(self._place(closing.task), {})[closing] = pressed
        for place, group in by_place.items():
            place.parent.mkdir(parents=True, exist_ok=True)
            beside = place.with_suffix(".new")
            beside.write_bytes(pickle.dumps(group))
            beside.replace(place)

    def _place(self, task: Task) -> Path:
        if task.kind not in self._hashes:
            self._hashes[task.kind] = made_by(find_recipe(task.kind, self._recipes))
        return self._folder / self._hashes[task.kind] / f"{task.kind}-{task.group}-{task.seeds}.pickle"


def made_by(recipe: Recipe) -> str:
    """Return a hash over the code and the recipe's part that decide what is measured.

    Args:
        recipe: by which it is.
    """
    root = Path(station.__file__).parent
    digest = hashlib.sha256(Path(__file__).read_bytes())
    for name in ("specimens.py", "sweep.py"):
        digest.update(Path(__file__).with_name(name).read_bytes())
    way = f"{recipe.steps.measured}{recipe.steps.step_mm}{recipe.gripper!r}{steps_to_decide(recipe)}"
    digest.update(f"{way}{recipe.segmentation!r}{recipe.imaging!r}".encode())
    for name in _DECIDED_BY:
        place = root / name
        for file in [place] if place.is_file() else sorted(place.rglob("*.[pn][yp]*")):
            digest.update(file.read_bytes())
    return digest.hexdigest()[:12]

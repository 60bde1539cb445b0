"""Data sets of the fit in two parts, one to fit on and one for validation: rendered once, and cached.

A value is taken only where both gain, so neither is a test. The cache's files carry a hash of the code that
renders them.
"""

import hashlib
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Literal, NamedTuple

from measurement.data_sets import PressData, cached, fruit_presses, in_processes, read, real_presses, soft_presses
from measurement.soft_bodies import KINDS

from fit.images import (
    border,
    compressed,
    large_balls,
    moved_debris,
    other_units,
    shadows,
    untouched,
    untouched_twin,
    weak_contacts,
)
from fit.progress import report

ROOT = Path(__file__).resolve().parents[2]
RENDERING = (
    *sorted((ROOT / "station" / "twin").rglob("*.py")),
    *(ROOT / "benchmarks" / "measurement" / f"{name}.py" for name in ("data_sets", "on_the_twin", "soft_bodies")),
    ROOT / "benchmarks" / "measurement" / "at_the_border.py",
    ROOT / "benchmarks" / "bench_measurement.py",
    Path(__file__).with_name("images.py"),
)
"""Code on which the rendered images depend."""

Part = Literal["fit", "validation"]
SEEDS: dict[Part, dict[str, int]] = {
    "fit": {
        "fruit": 0,
        "bruised": 20000,
        "soft": 5000,
        "border": 43000,
        "debris": 61000,
        "weak": 62000,
        "large": 51000,
        "unit": 33000,
        "noise": 1,
    },
    "validation": {
        "fruit": 2600,
        "bruised": 22800,
        "soft": 7000,
        "border": 44000,
        "debris": 71000,
        "weak": 72000,
        "large": 52000,
        "unit": 32000,
        "noise": 2,
    },
}
"""First seed of each data set; a press's seed is this plus its number."""
FRUIT_STEPS = (0, 1, 3, 4, 6, 8, 10)
"""Of the closings, to save time: nothing touching, weak contacts, and firm ones up to the largest."""
SOFT_SEEDS = 4
SOFT_EVERY = 3
"""Of a soft body's steps, as many are measured by themselves: up to the last, a full field."""


class Group(NamedTuple):
    """One data set with how its presses are measured."""

    presses: list[PressData]
    weight: float = 1.0
    """In the cost."""
    followed: bool = False
    """Whether a press's steps are followed from one to the next, or each measured by itself."""
    scored: Literal["area", "found", "judged"] = "area"
    """What counts: the area, whether a weak contact is found, or whether anything is judged where nothing may be."""


Groups = dict[str, Group]


def groups(part: Part, images: Path, cache: Path) -> Groups:
    """Read the data sets of one part, and render those that the cache does not have.

    Args:
        part: to fit on, or for validation.
        images: the folder of real images.
        cache: the cache's folder.
    """
    seeds = SEEDS[part]
    odd = part == "validation"
    version = _version(images)

    def data(name: str, make: Callable[[], list[PressData]]) -> list[PressData]:
        began = time.monotonic()
        found = cached(f"{name}-{part}", make, cache, version)
        if (took_s := time.monotonic() - began) > 5:
            report(f"{name}, {part}: rendered in {took_s:.0f} s")
        return found

    backgrounds = [*sorted((images / "digit_backgrounds").glob("*.jpg")), images / "digit_presses" / "reference.jpg"]
    own = [read(path) for path in backgrounds[odd::2]]
    fruit, bruised = (
        [_some_steps(press) for press in data(name, partial(fruit_presses, seeds[name], bruised=name == "bruised"))]
        for name in ("fruit", "bruised")
    )
    first = seeds["soft"]
    parts = [partial(soft_presses, range(first + k, first + k + SOFT_SEEDS // 2)) for k in (0, SOFT_SEEDS // 2)]
    soft = data("soft", partial(in_processes, parts))
    found = {
        "real ball": Group(real_presses(images / "digit_presses")[odd::2], 2.0),
        "untouched": Group(untouched(own, seeds["noise"])),
        "untouched, compressed": Group(data("compressed", partial(compressed, own, seeds["noise"]))),
        "untouched twin": Group(data("untouched-twin", partial(untouched_twin, seeds["unit"]))),
        "moved debris": Group(data("debris", partial(moved_debris, seeds["debris"])), 0.25),
        "other unit": Group(other_units(own), 0.25, scored="judged"),
        "shadow": Group(data("shadow", partial(shadows, own, seeds["noise"])), 0.25),
        "weak contact": Group(data("weak", partial(weak_contacts, seeds["weak"])), 0.5, scored="found"),
        # Followed as by the station.
        "fruit": Group(fruit, followed=True),
        "bruised": Group(bruised, followed=True),
        "border": Group(data("border", partial(border, seeds["border"]))),
        "large ball": Group(data("large", partial(large_balls, seeds["large"])), 0.5),
    }
    for kind in KINDS:
        presses = [press for press in soft if press.group == kind]
        found[kind.replace("_", " ")] = Group(presses, 0.5, followed=True)
    # As in an analysis of single images, where no earlier step shows what touches.
    found |= {
        "fruit alone": Group(fruit, 0.25),
        "bruised alone": Group(bruised, 0.25),
        "soft alone": Group([_last_of_three(press) for press in soft], 0.25),
    }
    return found


def _some_steps(press: PressData) -> PressData:
    return press._replace(images=[press.images[k] for k in FRUIT_STEPS], truths=[press.truths[k] for k in FRUIT_STEPS])


def _last_of_three(press: PressData) -> PressData:
    last = slice(SOFT_EVERY - 1, None, SOFT_EVERY)
    return press._replace(images=press.images[last], truths=press.truths[last])


def _version(images: Path) -> str:
    digest = hashlib.sha256()
    for path in (*RENDERING, *sorted(images.rglob("*.jpg"))):
        digest.update(path.read_bytes())
    return digest.hexdigest()

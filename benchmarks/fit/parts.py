"""Data sets of the fit in two parts, one to fit on and one held back: rendered once, at the working size, and cached.

Nothing is chosen on the part that is held back. The cache's files carry a hash of the code that renders them.
"""

import hashlib
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Literal, NamedTuple

import cv2
import numpy as np
from bench_measurement import noisy
from measurement import on_the_twin
from measurement.at_the_border import PLACES
from measurement.data_sets import PressData, cached, fruit_presses, in_processes, read, real_presses, soft_presses
from measurement.light_touch import DETECTION_PLACES, DETECTION_UNITS, light_closings
from measurement.soft_bodies import KINDS, moved_specks, with_jpeg, with_video
from measurement.untouched import CONDITIONS

from fit.progress import report
from station.twin.contact import Pose
from station.twin.digit.press import PressOptions
from station.twin.digit.sensor import DigitSensor
from station.vision.contact import Image
from station.vision.step import mean_image
from station.vision.working import working_image

ROOT = Path(__file__).resolve().parents[2]
RENDERING = (
    *sorted((ROOT / "station" / "twin").rglob("*.py")),
    *(ROOT / "benchmarks" / "measurement" / f"{name}.py" for name in ("data_sets", "on_the_twin", "soft_bodies")),
    ROOT / "benchmarks" / "measurement" / "at_the_border.py",
    ROOT / "benchmarks" / "bench_measurement.py",
    Path(__file__),
)
"""Code on which the rendered images depend."""

Part = Literal["fit", "held back"]
SEEDS: dict[Part, dict[str, int]] = {
    "fit": {
        "fruit": 0,
        "bruised": 20000,
        "soft": 5000,
        "border": 43000,
        "debris": 61000,
        "weak": 62000,
        "unit": 33000,
        "noise": 1,
    },
    "held back": {
        "fruit": 2600,
        "bruised": 22800,
        "soft": 7000,
        "border": 44000,
        "debris": 71000,
        "weak": 72000,
        "unit": 32000,
        "noise": 2,
    },
}
"""First seed of each data set; a press's seed is this plus its number."""
FRUIT_STEPS = (0, 1, 3, 4, 6, 8, 10)
"""Of the closings, to save time: nothing touching, weak contacts, and firm ones up to the largest."""
SOFT_SEEDS = 4
BORDER_CLOSINGS_MM = (1.2, 2.5, 5.0)
AFTER_S = (5.0, 11.0)
"""Since the reference."""
LEAST_QUALITY, MOST_QUALITY = 30, 60
"""JPEG's: files from the web."""


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
        part: to fit on, or held back.
        images: the folder of real images.
        cache: the cache's folder.
    """
    seeds = SEEDS[part]
    odd = part == "held back"
    version = _version(images)

    def data(name: str, make: Callable[[], list[PressData]]) -> list[PressData]:
        began = time.monotonic()
        found = cached(f"{name}-{part.replace(' ', '-')}", make, cache, version)
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
        "weak contact": Group(data("weak", partial(weak_contacts, seeds["weak"])), 0.5, scored="found"),
        # Followed as by the station.
        "fruit": Group(fruit, followed=True),
        "bruised": Group(bruised, followed=True),
        "border": Group(data("border", partial(border, seeds["border"]))),
    }
    for kind in KINDS:
        presses = [press for press in soft if press.group == kind]
        found[kind.replace("_", " ")] = Group(presses, 0.5, followed=True)
    return found


def untouched(backgrounds: list[Image], seed: int, draws: int = 3) -> list[PressData]:
    """Backgrounds of real units, each against itself with noise and drift."""
    found: list[PressData] = []
    for number, background in enumerate(backgrounds):
        generator = np.random.default_rng([seed, number])
        reference = _larger(background) if number % 2 else background
        frames = [working_image(noisy(reference, generator)) for _ in range(draws)]
        found.append(_empty("untouched", [working_image(reference)], frames))
    return found


def compressed(backgrounds: list[Image], seed: int) -> list[PressData]:
    """The same, reference and frames stored as JPEG of low quality, or as one video."""
    found: list[PressData] = []
    for number, background in enumerate(backgrounds):
        generator = np.random.default_rng([seed, number, 1])
        reference = _larger(background) if number % 2 else background
        for _ in range(2):
            quality = int(generator.integers(LEAST_QUALITY, MOST_QUALITY + 1))
            stored = with_jpeg([reference, noisy(reference, generator)], quality)
            found.append(_empty("JPEG", [working_image(stored[0])], [working_image(stored[1])]))
        # Several frames on: by then the codec has passed on what the first key frame left out.
        film = with_video([reference, *(noisy(reference, generator) for _ in range(4))])
        found.append(_empty("video", [working_image(film[0])], [working_image(film[-1])]))
    return found


def other_units(backgrounds: list[Image]) -> list[PressData]:
    """Untouched frames of one real unit against the reference of the next, of the same size."""
    sizes = {one.shape for one in backgrounds}
    found: list[PressData] = []
    for shape in sorted(sizes):
        own = [one for one in backgrounds if one.shape == shape]
        pairs = zip(own, [*own[1:], own[0]], strict=True) if len(own) > 1 else ()
        found += [_empty("other unit", [working_image(a)], [working_image(b)]) for a, b in pairs]
    return found


def untouched_twin(seed: int, units: int = 24) -> list[PressData]:
    """Untouched units of the twin as they drift away from their reference, in four conditions."""
    found: list[PressData] = []
    for unit in range(seed, seed + units):
        for condition in CONDITIONS:
            options = on_the_twin.conditions()[condition]
            sensor = DigitSensor(unit, unit, options.noise, options.drift)
            references = [
                sensor.frame(None, k / on_the_twin.FRAMES_PER_S, options.condition) for k in range(options.references)
            ]
            frames = [
                [
                    sensor.frame(None, after_s + k / on_the_twin.FRAMES_PER_S, options.condition)
                    for k in range(on_the_twin.FRAMES_PER_STEP)
                ]
                for after_s in AFTER_S
            ]
            found.append(
                _empty(
                    f"untouched, {condition}",
                    [working_image(one) for one in references],
                    [working_image(mean_image(step)) for step in frames],
                )
            )
    return found


def moved_debris(seed: int, pairs: int = 12) -> list[PressData]:
    """Untouched gel of the twin with specks of debris, some of which have moved since the reference."""
    return [
        _empty(
            "moved debris", [working_image(one) for one in pair.references], [working_image(mean_image(pair.frames))]
        )
        for pair in moved_specks(range(seed, seed + pairs))
    ]


def weak_contacts(seed: int) -> list[PressData]:
    """Contacts of about 0.7, 1 and 2 mm² of each fruit at several places on two units."""
    found: list[PressData] = []
    for kind in on_the_twin.FRUITS:
        for number, (x_px, y_px) in enumerate(DETECTION_PLACES):
            options = PressOptions(pose=Pose(x_px, y_px), unit=DETECTION_UNITS[number % 2])
            closings_mm = light_closings(kind, seed + number, options)[:2]
            press = on_the_twin.squeezed_with_masks(
                kind, seed + number, options, closings_mm=[0.6 * closings_mm[0], *closings_mm]
            )
            found.append(PressData(f"{kind}, weak", *press))
    return found


def border(seed: int) -> list[PressData]:
    """Contacts that the border cuts, two fruits at each place of `at_the_border`: the truth is their visible part."""
    found: list[PressData] = []
    for place, middles in PLACES.items():
        for number, (x_px, y_px) in enumerate(middles):
            for kind in on_the_twin.FRUITS[number % 2 :: 2]:
                options = PressOptions(pose=Pose(x_px, y_px), unit=number or None)
                references, images, truths = on_the_twin.squeezed_with_masks(
                    kind, seed + number, options, closings_mm=BORDER_CLOSINGS_MM
                )
                cut = [any(side.any() for side in (t[[0, -1]], t[:, [0, -1]])) for t in truths]
                seen = [k for k, is_cut in enumerate(cut) if is_cut]
                if seen:
                    kept = [images[k] for k in seen], [truths[k] for k in seen]
                    found.append(PressData(f"{kind}, {place}", references, *kept))
    return found


def _some_steps(press: PressData) -> PressData:
    images, truths = ([some[k] for k in FRUIT_STEPS] for some in (press.images, press.truths))
    return press._replace(images=images, truths=truths)


def _empty(group: str, references: list[Image], frames: list[Image]) -> PressData:
    return PressData(group, references, frames, [np.zeros(frame.shape[:2], np.bool_) for frame in frames])


def _larger(image: Image) -> Image:
    """As a camera of 640x480 would give it: its noise is finer than the working size."""
    if max(image.shape) >= 640:
        return image
    return np.asarray(cv2.resize(image, (480, 640), interpolation=cv2.INTER_CUBIC), np.uint8)


def _version(images: Path) -> str:
    digest = hashlib.sha256()
    for path in (*RENDERING, *sorted(images.rglob("*.jpg"))):
        digest.update(path.read_bytes())
    return digest.hexdigest()

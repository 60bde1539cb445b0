"""Presses of soft, textured, hollow and long bodies on the twin, and compressed, mixed-up or dirty frames.

A press runs from no touch to a full field, or to a firm press of a ring or rod. Each seed draws the body, its place,
the sensor's unit, the bands' strength and the shade of a flat dent. The true mask is where the body touches the gel:
of a ring the rim alone, until its inside touches too.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from station.twin.contact import Mask, Pose
from station.twin.digit.codec import Image, as_jpeg
from station.twin.digit.loaded import band_share
from station.twin.digit.sensor import Condition, DigitSensor
from station.twin.gel import MM_PER_PX, SENSOR_SHAPE

from .soft.body import SoftKind, draw_soft_body
from .soft.contact import SoftOnGel
from .video import Codec, with_video

KINDS = tuple(str(kind) for kind in SoftKind)
FILLING = (SoftKind.SOFT_BALL, SoftKind.FOAM, SoftKind.COARSE_FRUIT, SoftKind.SMOOTH_FRUIT)
"""Bodies that come to cover the field."""
REFERENCES = 5
FRAMES_PER_STEP = 3
STEPS = 12
FRAMES_PER_S = 30.0
STEP_S = 1.0
UNITS = 1000
"""Units are drawn from as many seeds; one press in six is on the unit that the optics were fitted on."""

BAND_LEVELS, FAINT_BAND_LEVELS = (5.0, 50.0), (0.0, 12.0)
"""Grey levels of the brightest band at a press's last step: bodies that fill the field, and the others. Estimates."""
SHADE_PER_MM = (2.0, 15.0)
"""Grey levels that a flat dent changes for each mm of depth. An estimate from the middles of the 30 real ball presses,
where the gel has no slope: medians of the colours 2 to 3, standard deviations 6 to 13, annotation errors included."""
FOAM_SHADE_LEVELS = (1.0, 5.0)
"""Grey levels that a foam changes at least, where it dents the gel deepest. An estimate."""

_OFF_CENTRE_MM = 2.0
_TOUCHING_POWER = (1.0, 1.8)
"""Steps of the compression grow by this power: more of them lie at small contacts."""


class SoftStep(NamedTuple):
    """One compression step."""

    frames: list[Image]
    true_mask: Mask
    """Where the body touches the gel in the field, shape (640, 480), 0 or 255."""
    true_area_px: int
    force_n: float
    compression_mm: float
    """Approach of body and gel since the first touch; 0 or less before it."""


class SoftPress(NamedTuple):
    """One body pressed step by step."""

    kind: str
    seed: int
    unit: int | None
    references: list[Image]
    steps: list[SoftStep]
    """In order of rising compression; the first one or two touch nothing."""


class Untouched(NamedTuple):
    """References and frames between which nothing has touched the gel."""

    references: list[Image]
    frames: list[Image]


def soft_presses(
    seeds: Iterable[int],
    kinds: Sequence[str] = KINDS,
    frames_per_step: int = FRAMES_PER_STEP,
    steps: int = STEPS,
) -> Iterator[SoftPress]:
    """One press of each kind for each seed; the same arguments give the same frames.

    Args:
        seeds: of the presses.
        kinds: of `KINDS`.
        frames_per_step: frames at each compression.
        steps: compressions, of which the first one or two touch nothing; at least three.
    """
    for seed in seeds:
        for kind in kinds:
            yield soft_press(kind, seed, frames_per_step, steps)


def soft_press(
    kind: str, seed: int, frames_per_step: int = FRAMES_PER_STEP, steps: int = STEPS, debris: int = 0
) -> SoftPress:
    """One press.

    Args:
        kind: of `KINDS`.
        seed: of everything that is drawn.
        frames_per_step: frames at each compression.
        steps: compressions.
        debris: specks on the gel, some of which move between the references and the first step.
    """
    generator = np.random.default_rng([seed, KINDS.index(kind), 20])
    body_seed = int(generator.integers(1 << 31))
    unit = int(generator.integers(UNITS)) if generator.random() > 1 / 6 else None
    contact = SoftOnGel(draw_soft_body(kind, body_seed), _pose(kind, generator))
    compressions_mm = _compressions_mm(kind, contact, steps, generator)
    condition = replace(_condition(kind, contact, compressions_mm[-1], generator), dirt=debris)
    sensor = DigitSensor(body_seed, unit)
    press = SoftPress(kind, seed, unit, _references(sensor, condition), [])
    condition = replace(condition, dirt_moved=1 + seed)
    for number, compression_mm in enumerate(compressions_mm):
        seen = contact.pressed(compression_mm)
        began_s = REFERENCES / FRAMES_PER_S + (number + 1) * STEP_S
        dent = seen.dent if compression_mm > 0 else None
        frames = [sensor.frame(dent, began_s + k / FRAMES_PER_S, condition) for k in range(frames_per_step)]
        press.steps.append(SoftStep(frames, seen.true_mask, seen.true_area_px, seen.force_n, compression_mm))
    return press


def with_jpeg(images: Sequence[Image], quality: int) -> list[Image]:
    """The images after JPEG.

    Args:
        images: any frames.
        quality: 1 to 100; files from the web have 30 to 60.
    """
    return [as_jpeg(image, quality) for image in images]


def press_with_video(press: SoftPress, codec: Codec = "mp4v", quality: int | None = None) -> SoftPress:
    """A press stored as one video, references first."""
    images = [*press.references, *(frame for step in press.steps for frame in step.frames)]
    decoded = iter(with_video(images, codec, quality))
    references = [next(decoded) for _ in press.references]
    steps = [step._replace(frames=[next(decoded) for _ in step.frames]) for step in press.steps]
    return press._replace(references=references, steps=steps)


def press_with_other_reference(press: SoftPress) -> SoftPress:
    """The same press judged by the references of another unit."""
    generator = np.random.default_rng([press.seed, 21])
    other = int(generator.integers(UNITS, 2 * UNITS))
    return press._replace(references=_references(DigitSensor(other, other)))


def other_unit_pairs(seeds: Iterable[int], frames: int = FRAMES_PER_STEP) -> Iterator[Untouched]:
    """References of one unit with untouched frames of another one.

    Args:
        seeds: of the pairs.
        frames: untouched frames of each.
    """
    for seed in seeds:
        first, second = (int(unit) for unit in np.random.default_rng([seed, 22]).choice(UNITS, 2, replace=False))
        sensor = DigitSensor(seed, second)
        yield Untouched(
            _references(DigitSensor(seed + 1, first)),
            [sensor.frame(None, STEP_S + number / FRAMES_PER_S) for number in range(frames)],
        )


def moved_specks(seeds: Iterable[int], frames: int = FRAMES_PER_STEP) -> Iterator[Untouched]:
    """References of a gel with one to six specks of debris, and untouched frames after some have moved.

    Args:
        seeds: of the pairs.
        frames: untouched frames of each.
    """
    for seed in seeds:
        generator = np.random.default_rng([seed, 23])
        sensor = DigitSensor(seed, int(generator.integers(UNITS)))
        count = int(generator.integers(1, 7))
        before, after = Condition(dirt=count), Condition(dirt=count, dirt_moved=1 + seed)
        yield Untouched(
            _references(sensor, before),
            [sensor.frame(None, STEP_S + number / FRAMES_PER_S, after) for number in range(frames)],
        )


def _references(sensor: DigitSensor, condition: Condition | None = None) -> list[Image]:
    return [sensor.frame(None, number / FRAMES_PER_S, condition) for number in range(REFERENCES)]


def _pose(kind: str, generator: np.random.Generator) -> Pose:
    """Up to 2 mm off the centre, turned anyhow; rings and rods lean a little, so that one side touches first."""
    off_mm, way = _OFF_CENTRE_MM * np.sqrt(generator.random()), generator.uniform(0, 2 * np.pi)
    rows, columns = SENSOR_SHAPE
    x_px, y_px = columns / 2 + off_mm * np.cos(way) / MM_PER_PX, rows / 2 + off_mm * np.sin(way) / MM_PER_PX
    turn_deg, lean_deg = generator.uniform(0, 360), generator.normal(0.0, 1.0)
    return Pose(float(x_px), float(y_px), float(turn_deg), 0.0 if kind in FILLING else float(lean_deg))


def _compressions_mm(kind: str, contact: SoftOnGel, steps: int, generator: np.random.Generator) -> list[float]:
    """One or two steps before the first touch, then up to a full field or a firm press."""
    before = int(generator.integers(1, 3))
    if kind in FILLING:
        # Four in five come to cover three quarters of the field or all of it, and go on a little beyond.
        covered = generator.uniform(0.75, 1.0) if generator.random() < 0.8 else generator.uniform(0.3, 0.75)
        most_mm = contact.compression_mm(covered) * generator.uniform(1.0, 1.25)
    else:
        most_mm = generator.uniform(0.5, 1.3)
    share = np.linspace(0.0, 1.0, steps - before + 1)[1:] ** generator.uniform(*_TOUCHING_POWER)
    return [*(0.5 * (number - before + 1) for number in range(before)), *(most_mm * share).tolist()]


def _condition(kind: str, contact: SoftOnGel, most_mm: float, generator: np.random.Generator) -> Condition:
    """Answer of the unit's light to the load; see `BAND_LEVELS` and the constants beside it."""
    filling = kind in FILLING
    end_levels = generator.uniform(*(BAND_LEVELS if filling else FAINT_BAND_LEVELS))
    shade_per_mm = float(np.exp(generator.uniform(*np.log(SHADE_PER_MM))))
    dent = contact.pressed(most_mm).dent
    if kind == SoftKind.FOAM:
        shade_per_mm = max(shade_per_mm, generator.uniform(*FOAM_SHADE_LEVELS) / float(dent.max()))
    return Condition(bands=float(end_levels / band_share(float(dent.mean()))), depth_shade=shade_per_mm)

"""Cohort of a study: the paper's fruit, each with its own flesh, skin and place, and the images of its press.

Source of all numbers of the paper: Computers and Electronics in Agriculture 235 (2025) 110397.
"""

import csv
import importlib.resources
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from station.twin.contact import MIDDLE_X_PX, MIDDLE_Y_PX, Pose
from station.twin.digit.press import PressOptions, PressSequence, render_press
from station.twin.fruit import Fruit, Kind, draw_fruit

RESULT_CLOSINGS_MM: dict[Kind, tuple[float, ...]] = {
    Kind.STRAWBERRY: (4.0, 8.0, 12.0),
    Kind.BLUEBERRY: (8.0, 12.0, 16.0),
    Kind.RASPBERRY: (8.0, 12.0, 16.0),
    Kind.RUBBER_BALL: (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0),
}
"""Closings of the paper's results; the ball's are its widths from 41 to 35 mm, with the first contact at 42."""
PAPER_FAILURES: dict[Kind, int] = {Kind.STRAWBERRY: 6, Kind.BLUEBERRY: 8, Kind.RASPBERRY: 18}
"""Of `PAPER_SAMPLES` each: 20.0, 26.7 and 60.0 %, called pronounced fluctuations of the area over closing."""
PAPER_SAMPLES = 30
"""Fruit of each kind in the paper."""
FRUITS = tuple(str(kind) for kind in RESULT_CLOSINGS_MM)

STEP_MM = 1.0
"""Closing from one image to the next: of the ball the paper's, of fruit ours."""
_IMAGES, _BALL_IMAGES = 20, 14
"""Images of a fruit's press, so that they begin before its first contact, and of the ball's, the paper's."""
_BALL_FROM_MM = -4.0
"""The ball's images run from 46 to 33 mm of width, and 42 mm is the first contact."""
_STEP_S = 1.0
"""Time from one image to the next. An estimate."""
PLACE_PX, TURN_DEG, TILT_DEG = 19.0, 5.0, 2.0
"""Standard deviations of how a fruit is laid in by hand: half a millimetre and a few degrees. An estimate."""
_KIND_CODES = {kind: number for number, kind in enumerate(RESULT_CLOSINGS_MM)}


@dataclass(frozen=True, slots=True)
class Member:
    """One sample of a cohort; the same seed and number give the same fruit and the same images."""

    fruit: Fruit
    pose: Pose
    closings_mm: tuple[float, ...]
    """Of the images: 1 mm apart, ending at the last closing with a result, off by up to half a step: the first
    contact falls anywhere between two images."""
    noise_seed: int

    def press(self) -> PressSequence:
        """Render the images: five of the untouched gel, then one at each closing."""
        return render_press(self.fruit, self.noise_seed, self.closings_mm, PressOptions(pose=self.pose, step_s=_STEP_S))


def member(kind: Kind | str, seed: int, number: int) -> Member:
    """Draw sample `number`, from 0, of a kind of `FRUITS` in the study of a seed.

    Weight, length and width are those of the paper's sample `number` modulo 30; stiffness, creep, skin, place,
    phase of the steps and the sensor's noise are drawn. The ball is always 24 mm and closed to the paper's widths.

    Raises:
        ValueError: there is no such kind in the studies.
    """
    kind = Kind(kind)
    generator = np.random.default_rng([seed, _KIND_CODES[kind], number])
    fruit_seed, noise_seed = (int(one) for one in generator.integers(2**31, size=2))
    fruit = draw_fruit(kind, fruit_seed)
    x_px, y_px = generator.normal(0.0, PLACE_PX, 2)
    turn_deg, tilt_deg = generator.normal(0.0, (TURN_DEG, TILT_DEG))
    pose = Pose(MIDDLE_X_PX + x_px, MIDDLE_Y_PX + y_px, turn_deg, tilt_deg)
    phase_mm = float(generator.uniform(-0.5, 0.5)) * STEP_MM
    if kind == Kind.RUBBER_BALL:
        closings = _BALL_FROM_MM + STEP_MM * np.arange(_BALL_IMAGES)
    else:
        sizes = paper_sizes()[kind]
        weight_g, length_mm, width_mm = sizes[number % len(sizes)]
        fruit = replace(fruit, weight_g=weight_g, length_mm=length_mm, width_mm=width_mm)
        closings = RESULT_CLOSINGS_MM[kind][-1] + phase_mm + STEP_MM * np.arange(1 - _IMAGES, 1)
    return Member(fruit, pose, tuple(float(closing) for closing in closings), noise_seed)


@cache
def paper_sizes() -> dict[Kind, tuple[tuple[float, float, float], ...]]:
    """Weight g, length mm and width mm of the paper's fruit, in its order."""
    text = importlib.resources.files("station.studies").joinpath("paper_samples.csv").read_text(encoding="utf-8")
    rows = csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))
    sizes: dict[Kind, list[tuple[float, float, float]]] = {}
    for row in rows:
        size = float(row["weight_g"]), float(row["length_mm"]), float(row["width_mm"])
        sizes.setdefault(Kind(row["fruit"]), []).append(size)
    return {kind: tuple(rows) for kind, rows in sizes.items()}

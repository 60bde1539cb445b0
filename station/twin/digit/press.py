"""A whole press in one call, for tests, benchmarks and studies: what the sensor sees while a fruit is squeezed."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from station.twin.contact import FruitOnGel, Mask, Pose
from station.twin.digit.codec import Image
from station.twin.digit.sensor import Condition, DigitSensor
from station.twin.fruit import Fruit, Kind, draw_fruit
from station.twin.gel import Gel
from station.twin.squeeze import Squeeze


@dataclass(frozen=True, slots=True)
class PressOptions:
    """Options of a simulated press: the fruit's pose, the sensor and its images, and timing."""

    pose: Pose = field(default_factory=Pose)
    unit: int | None = None
    """Seed of the sensor's light; None for the unit that the optics were fitted on."""
    condition: Condition = field(default_factory=Condition)
    noise: float = 1.0
    """Factor on the noise of each frame."""
    drift: float = 1.0
    """Factor on the slow drift of the light."""
    references: int = 5
    """No-contact frames before the press."""
    step_s: float = 1.0
    """Time from one step's frame to the next, in which the light drifts and the fruit creeps."""


@dataclass(frozen=True, slots=True)
class PressSequence:
    """The frames of one press, one for each closing, with the truth."""

    references: list[Image]
    """Frames with nothing touching, each of shape (640, 480, 3), dtype uint8, BGR."""
    frames: list[Image]
    true_masks: list[Mask]
    """The contact inside its visible edge, shape (640, 480), 0 or 255; empty where nothing touches."""
    true_areas_mm2: list[float]
    closings_mm: list[float]
    widths_mm: list[float]
    forces_n: list[float]


def render_press(
    fruit: Fruit | Kind | str,
    seed: int,
    closings_mm: Sequence[float],
    options: PressOptions | None = None,
) -> PressSequence:
    """Squeeze a fruit step by step and draw what the sensor sees; the same arguments give the same frames.

    Args:
        fruit: a fruit, or a kind of which one is drawn from the seed.
        seed: of the fruit where it is drawn, and of the sensor's noise and drift.
        closings_mm: closing at each step, mm since first contact; 0 or less is not touching.
        options: pose, unit, condition, noise; a centred press on a sound sensor where left out.

    Raises:
        ValueError: there is no such kind.
    """
    options = options or PressOptions()
    if not isinstance(fruit, Fruit):
        fruit = draw_fruit(fruit, seed)
    gel = Gel()
    sensor = DigitSensor(seed, options.unit, options.noise, options.drift)
    contact = FruitOnGel(fruit, options.pose, gel)
    references = [sensor.frame(None, index / 30.0, options.condition) for index in range(options.references)]
    sequence = PressSequence(references, [], [], [], list(closings_mm), [], [])
    for step, closing_mm in enumerate(closings_mm):
        squeezed = Squeeze(fruit, gel, held_s=step * options.step_s).at(closing_mm)
        footprint = contact.pressed(squeezed)
        now_s = options.references / 30.0 + (step + 1) * options.step_s
        sequence.frames.append(sensor.frame(footprint.dent, now_s, options.condition))
        sequence.true_masks.append(footprint.true_mask)
        sequence.true_areas_mm2.append(footprint.true_area_mm2)
        sequence.widths_mm.append(fruit.width_mm - closing_mm)
        sequence.forces_n.append(squeezed.force_n)
    return sequence

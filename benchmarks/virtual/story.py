"""Story: a seed, a number of fruits and a list of troubles; drawn at random, and shrunk to the least that fails."""

import random
from collections.abc import Callable
from dataclasses import dataclass, replace

from plc_interface.plc_simulator.faults import LineFault

DEVICE_KINDS = ("off", "stuck", "garbage", "wrong", "slow", "delayed", "intermittent")
ARM_STOPS = ("protective_stop", "emergency_stop", "safety_fault")
KINDS: dict[str, tuple[str, ...]] = {
    "arm": (*DEVICE_KINDS[:3], *DEVICE_KINDS[4:], *ARM_STOPS),  # no measured value shows where the arm is
    "gripper": DEVICE_KINDS,
    "camera": DEVICE_KINDS,
    "vision": ("off", "stuck", "slow", "delayed", "intermittent"),
    "channel": ("off", "slow", "delayed", "intermittent"),
    "disk": ("full", "slow", "stuck"),
    "station": ("kill",),
    "interface": ("kill",),
    "clock": ("forward", "back"),
    "plc": ("pause", *(fault.value for fault in LineFault)),
}
"""What can go wrong, by the part. A PLC's mistake, but for its pause, is made with one fruit."""
FRUIT_S = 3.0
"""About the time from one fruit to the next."""


@dataclass(frozen=True, slots=True)
class Trouble:
    """One thing that goes wrong."""

    part: str
    kind: str
    at_s: float
    """From the story's begin."""
    lasts_s: float

    @property
    def name(self) -> str:
        """Part and kind, for tables."""
        return f"{self.part} {self.kind}"

    @property
    def fruit(self) -> int:
        """The fruit with which a PLC's mistake is made."""
        return 1 + int(self.at_s / FRUIT_S)


@dataclass(frozen=True, slots=True)
class Story:
    """Everything that a play follows from."""

    seed: int
    fruits: int
    troubles: tuple[Trouble, ...]
    carries: bool
    """Whether the arm carries judged fruit to their places."""

    @property
    def calm_s(self) -> float:
        """From when on nothing goes wrong any more."""
        return max((trouble.at_s + trouble.lasts_s for trouble in self.troubles), default=0.0)


def draw(seed: int, fruits: int) -> Story:
    """Draw a story with about one trouble to eight fruits."""
    rng = random.Random(seed)
    parts = list(KINDS)

    def trouble() -> Trouble:
        part = rng.choice(parts)
        lasts_s = rng.choice((0.3, 1.0, 3.0, 10.0)) * rng.uniform(0.5, 1.5)
        return Trouble(part, rng.choice(KINDS[part]), round(rng.uniform(1, fruits * FRUIT_S), 3), round(lasts_s, 3))

    troubles = sorted((trouble() for _ in range(max(1, fruits // 8))), key=lambda each: each.at_s)
    return Story(seed, fruits, tuple(troubles), carries=rng.random() < 0.5)


def shrink(story: Story, fails: Callable[[Story], bool]) -> Story:
    """Leave out troubles, then fruits, as long as the story fails; delta debugging, Zeller and Hildebrandt 2002.

    Args:
        story: one that fails.
        fails: whether a story fails in the same way.
    """
    size = max(1, len(story.troubles) // 2)
    while story.troubles:
        starts = range(0, len(story.troubles), size)
        remaining = [story.troubles[:start] + story.troubles[start + size :] for start in starts]
        less = next((each for troubles in remaining if fails(each := replace(story, troubles=troubles))), None)
        if less is not None:
            story = less
        elif size == 1:
            break
        size = max(1, min(size, len(story.troubles)) // (1 if less is not None else 2))
    low, high = 1, story.fruits
    while low < high:
        middle = (low + high) // 2
        if fails(replace(story, fruits=middle)):
            high = middle
        else:
            low = middle + 1
    return replace(story, fruits=high)

"""Evaluation: measures the data sets with given constants, and records on which constants each image depends."""

from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from measurement.data_sets import PressData
from scipy.stats import rankdata

from fit.parts import Group
from station.settings.segmentation import RobustParameters
from station.twin.gel import MM_PER_PX
from station.vision.constants import CONSTANTS, Constants
from station.vision.contact import Contact
from station.vision.median import median_image
from station.vision.press import PressTracker
from station.vision.robust import RobustMethod
from station.vocabulary import Flag

LARGE_ERROR = 0.25
LEAST_MM2 = 2.0
_MM2_PER_PX = (2 * MM_PER_PX) ** 2
"""At the working size."""

_BITS = {one.name: 1 << number for number, one in enumerate(fields(Constants))}
"""One for each constant."""

Floats = npt.NDArray[np.float64]


class Trial(NamedTuple):
    """One variant of the method."""

    constants: Constants = CONSTANTS
    parameters: RobustParameters = RobustParameters()
    without: frozenset[str] = frozenset()


class Step(NamedTuple):
    """One measured image."""

    area_px: int
    true_px: int
    error: float
    """Of the area against the truth, relative; 0 where nothing touches."""
    overlap: float
    """Intersection over union with the truth; 1 where both are empty."""
    judged: bool
    dropped: bool
    """Judged, and more than a quarter under an earlier judged area of a followed press."""
    read: int
    """Bits of the constants on which the step depends."""

    @property
    def true_mm2(self) -> float:
        """The truth's area, of an image at the working size."""
        return self.true_px * _MM2_PER_PX

    @property
    def has_area(self) -> bool:
        """True if a contact was found."""
        return self.area_px > 0


class PressScore(NamedTuple):
    """One measured press."""

    group: str
    steps: list[Step]
    spearman: float
    """Of measured and true areas above 2 mm²; NaN of a press that is not followed or has fewer than three."""


Scores = dict[str, list[PressScore]]


class Base(NamedTuple):
    """A trial that is measured already: what another trial cannot change is taken over from it."""

    trial: Trial
    scores: Scores

    def unread(self, trial: Trial) -> int | None:
        """The bits of the constants in which another trial differs, or None where it differs in more than those."""
        if (trial.parameters, trial.without) != (self.trial.parameters, self.trial.without):
            return None
        own, other = self.trial.constants, trial.constants
        return sum(bit for name, bit in _BITS.items() if getattr(own, name) != getattr(other, name))


def measure(groups: Mapping[str, Group], trial: Trial, base: Base | None = None) -> Scores:
    """Measure all presses of the data sets.

    Args:
        groups: the data sets.
        trial: the variant of the method.
        base: of the same data sets; images are only measured where a constant is read that differs from its trial's.
    """
    changed = base.unread(trial) if base else None
    found: Scores = {}
    for name, group in groups.items():
        known = base.scores[name] if base and changed is not None else [None] * len(group.presses)
        pairs = zip(group.presses, known, strict=True)
        found[name] = [
            measure_press(one, trial, before, changed or 0, followed=group.followed) for one, before in pairs
        ]
    return found


def measure_press(
    press: PressData, trial: Trial, known: PressScore | None = None, changed: int = 0, *, followed: bool
) -> PressScore:
    """Measure one press.

    Args:
        press: its images and truths.
        trial: the variant of the method.
        known: the score with other constants.
        changed: bits of the constants that differ from those.
        followed: whether to follow the contact from step to step.
    """
    same = [bool(known) and not step.read & changed for step in known.steps] if known else [False] * len(press.images)
    if known and all(same):
        return known
    constants, read = _recorded(trial.constants)
    method = RobustMethod(median_image(press.references), trial.parameters, constants, trial.without)
    prepared = read()
    least = trial.parameters.least_confidence
    tracker = PressTracker(method) if followed else None
    steps: list[Step] = []
    largest_judged_px = 0
    for number, (image, truth) in enumerate(zip(press.images, press.truths, strict=True)):
        if known and same[number] and not followed:
            steps.append(known.steps[number])
            continue
        contact = tracker.measure_step([image]) if tracker else method.measure(image)
        judged = is_judged(contact, least)
        drop = followed and judged and contact.area_px < (1 - LARGE_ERROR) * largest_judged_px
        steps.append(_step(contact, truth, judged=judged, dropped=drop, read=prepared | read()))
        if judged:
            largest_judged_px = max(largest_judged_px, contact.area_px)
    areas = [(step.area_px, step.true_px) for step in steps if step.true_mm2 > LEAST_MM2]
    ordered = spearman(areas) if followed and len(areas) > 2 else float("nan")
    return PressScore(press.group, steps, ordered)


def _recorded(constants: Constants) -> tuple[Constants, Callable[[], int]]:
    """The same constants, and a function that returns the bits of those that were read since it was last called."""
    names: set[str] = set()

    class Recorder(Constants):  # pyrefly: ignore[bad-class-definition] (it is no dataclass of its own)
        __slots__ = ()

        def __getattribute__(self, name: str) -> Any:
            names.add(name)
            return super().__getattribute__(name)

    def read() -> int:
        bits = sum(bit for name, bit in _BITS.items() if name in names)
        names.clear()
        return bits

    return Recorder(**{one.name: getattr(constants, one.name) for one in fields(Constants)}), read


def is_judged(contact: Contact, least_confidence: float) -> bool:
    """Return whether the station would make a result of a contact."""
    doubts = {Flag.LOW_CONFIDENCE, Flag.UNDECIDED, Flag.REFERENCE_MISMATCH} & contact.flags
    return contact.found and not doubts and (contact.confidence or 0.0) >= least_confidence


def spearman(areas: list[tuple[int, int]]) -> float:
    """Rank correlation of measured and true areas; 0 where one of them never changes."""
    ranks = np.array([rankdata(side) for side in zip(*areas, strict=True)])
    if (np.ptp(ranks, axis=1) == 0).any():
        return 0.0
    return float(np.corrcoef(ranks)[0, 1])


def _step(contact: Contact, truth: npt.NDArray[np.bool_], *, judged: bool, dropped: bool, read: int) -> Step:
    true_px = int(np.count_nonzero(truth))
    both = int(np.count_nonzero((contact.mask > 0) & truth))
    either = contact.area_px + true_px - both
    error = abs(contact.area_px / true_px - 1) if true_px else 0.0
    overlap = both / either if either else 1.0
    return Step(contact.area_px, true_px, error, overlap, judged, dropped, read)

"""Soft, textured, hollow and long bodies of the twin: followed step by step, and each step by itself."""

from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt
from scipy.stats import rankdata

from measurement import soft_bodies
from measurement.data_sets import filled
from measurement.peers import PEER, contact_area_idea
from station.settings.segmentation import RobustParameters
from station.twin.gel import MM_PER_PX
from station.vision.contact import Contact
from station.vision.median import median_image
from station.vision.press import PressTracker
from station.vision.robust import RobustMethod
from station.vision.step import mean_image, measure_step
from station.vocabulary import Flag

SEEDS = range(100_000, 100_050)
"""Six bodies each, of which four come to fill the field. Nothing was chosen on them."""
LARGE_ERROR = 0.25
_LEAST_PX = 2 / MM_PER_PX**2
_LEAST_STEPS = 3

Floats = npt.NDArray[np.float64]


class Steps(NamedTuple):
    """One press as one of the ways measured it: an entry for each step."""

    kind: str
    way: str
    true_px: Floats
    forces_n: Floats
    areas_px: Floats
    judged: npt.NDArray[np.bool_]

    @property
    def large(self) -> npt.NDArray[np.bool_]:
        """Steps whose contact is over 2 mm²."""
        return self.true_px > _LEAST_PX

    @property
    def missed(self) -> int:
        """Large steps without an area."""
        return int(np.sum(self.areas_px[self.large] == 0))

    @property
    def rank(self) -> float | None:
        """Spearman's correlation of area and force from the first area on; None of fewer than three steps."""
        seen = self.large & (np.maximum.accumulate(self.areas_px) > 0)
        areas, forces = self.areas_px[seen], self.forces_n[seen]
        if len(areas) < _LEAST_STEPS:
            return None
        if np.ptp(areas) == 0:
            return 0.0
        # Spearman's coefficient is Pearson's of the ranks; equal areas share theirs.
        return float(np.corrcoef(rankdata(areas), rankdata(forces))[0, 1])

    @property
    def drops(self) -> int:
        """Judged areas more than 25 % under an earlier judged one."""
        judged = self.areas_px[self.judged]
        return int(np.sum(judged < 0.75 * np.maximum.accumulate(judged))) if judged.size else 0

    @property
    def errors(self) -> Floats:
        """Of the large steps' areas, relative."""
        return np.abs(self.areas_px[self.large] / self.true_px[self.large] - 1)


FOLLOWED, ALONE = "followed", "each step by itself"


def measured_press(seed: int) -> list[Steps]:
    """All bodies of one seed, measured in each way."""
    cv2.setNumThreads(1)
    found: list[Steps] = []
    for press in soft_bodies.soft_presses([seed]):
        method = RobustMethod(median_image(press.references), RobustParameters())
        tracker, peer = PressTracker(method), contact_area_idea(median_image(press.references))
        true_px = np.array([np.count_nonzero(filled(step.true_mask)) for step in press.steps], float)
        forces_n = np.array([step.force_n for step in press.steps])
        contacts = {
            FOLLOWED: [tracker.measure_step(step.frames) for step in press.steps],
            ALONE: [measure_step(method, step.frames) for step in press.steps],
        }
        for way, some in contacts.items():
            areas_px, judged = np.array([float(one.area_px) for one in some]), np.array([_judged(one) for one in some])
            found.append(Steps(press.kind, way, true_px, forces_n, areas_px, judged))
        peer_px = np.array([float(np.count_nonzero(peer(mean_image(step.frames)))) for step in press.steps])
        found.append(Steps(press.kind, PEER, true_px, forces_n, peer_px, np.zeros(len(peer_px), np.bool_)))
    return found


def _judged(contact: Contact) -> bool:
    return contact.found and not contact.flags & {Flag.LOW_CONFIDENCE, Flag.UNDECIDED, Flag.REFERENCE_MISMATCH}


def soft_table(seeds: Sequence[int] = SEEDS) -> list[str]:
    """Errors, rank correlation with the force, and falls of the judged area, by kind of body."""
    with ProcessPoolExecutor(2) as pool:
        presses = [one for some in pool.map(measured_press, seeds) for one in some]
    header = (
        "| bodies | way | presses | steps | without an area | error of the others: median | p95 | judged | of them "
        "wrong by over 25 % | Spearman with the force: median | p10 | 0.99 or more | judged 25 % under an earlier one |"
    )
    lines = [header, "|---|---|---|---|---|---|---|---|---|---|---|---|---|"]
    filling = tuple(str(kind) for kind in soft_bodies.FILLING)
    for name, kinds in (("all that fill the field", filling), *((kind, (kind,)) for kind in soft_bodies.KINDS)):
        for way in (FOLLOWED, ALONE, *([PEER] if len(kinds) > 1 else [])):
            some = [one for one in presses if one.kind in kinds and one.way == way]
            lines.append(_row(name.replace("_", " "), way, some))
    return lines


def _row(name: str, way: str, presses: Sequence[Steps]) -> str:
    errors = np.concatenate([one.errors for one in presses])
    judged = np.concatenate([one.judged[one.large] for one in presses])
    found = np.concatenate([one.areas_px[one.large] > 0 for one in presses])
    ranks = np.array([one.rank for one in presses if one.rank is not None])
    wrong, count = int(np.sum(errors[judged] > LARGE_ERROR)), int(judged.sum())
    drops = sum(one.drops for one in presses)
    is_peer = way == PEER
    return (
        f"| {name} | {way} | {len(presses)} | {len(errors)} | {sum(one.missed for one in presses)} "
        f"| {np.median(errors[found]):.3f} | {np.quantile(errors[found], 0.95):.3f} "
        f"| {'' if is_peer else f'{count / len(errors):.0%}'} | {'' if is_peer else f'{wrong} of {count}'} "
        f"| {np.median(ranks):.3f} | {np.quantile(ranks, 0.1):.2f} | {np.mean(ranks >= 0.99):.0%} "
        f"| {'' if is_peer else f'{drops} of {count}'} |"
    )

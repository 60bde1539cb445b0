"""The station's own method: the contact's edge, under drift, streaks and weak light.

Stages: signed difference to the reference; drift and streaks taken off; bending and the gate; clusters of the bending,
as many as the data ask for; for each region the edge where the change falls off most steeply. `docs/robust.md`
explains each with its reasons.
"""

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np

from station.settings.segmentation import RobustParameters
from station.vision import pictures
from station.vision.bending import bending, noise_of, quiet
from station.vision.body import Movement, evening, find_body, has_moved_widely, movement
from station.vision.candidates import body_candidates, separate_candidates
from station.vision.contact import Contact, Flag, FloatImage, Image, Mask, StageSink, contact_from_mask
from station.vision.crumbs import Crumbs
from station.vision.drift import SPREAD_CAP_LEVELS, Drift, DriftModel, without_bands, without_streaks
from station.vision.edge_signal import denoised, length_of
from station.vision.outline import Outline, find_outline
from station.vision.working import SATURATED_LEVEL, capped, resized, working_image

PRINTED_LONG_SIDE_PX = 640
PRINTED_IMAGE_PX = 640 * 480
"""The image for which parameters in pixels are given; they scale with the image."""

_SATURATED_SHARE = 0.05
_FOREIGN_DRIFT_SHARE = 0.35
_ONE_SIDED = 0.85
_LEAST_SUPPORT, _LEAST_SUPPORT_CUT = 0.03, 0.25
"""Of an outline, and of one that the border cuts, which drift at the border resembles."""
_COARSE_STEP, _FINE_STEP = 4, 2
_LEAST_TRUST = 0.25
"""In a calm place that the drift does not fit: it may be a band of light or a skirt."""
_SURE_GATE = 2.0
_LEAST_LIGHT = 0.25
_GATE_OF_WIDE = 0.6
"""Of the gate's threshold, where so much has moved that the background's bending is the skirt's."""


class RobustMethod:
    """The robust measurement against one or several reference images."""

    stages: tuple[str, ...] = ("difference", "amplified", "denoised", "bending", "clustered", "edge", "segmented")

    def __init__(self, references: Sequence[Image], parameters: RobustParameters) -> None:
        """Prepare the reference, which is the median of the references.

        Args:
            references: one or more images with nothing touching, each (height, width, 3), dtype uint8, BGR.
            parameters: the recipe's.

        Raises:
            ValueError: there is no reference, or one is not a colour image of the others' size.
        """
        if not references:
            raise ValueError("no reference image: at least one frame with nothing touching the gel is needed")
        shape = references[0].shape
        if any(r.shape != shape or r.dtype != np.uint8 or r.ndim != 3 or r.shape[2] != 3 for r in references):
            raise ValueError(f"references must be uint8 images (height, width, 3) of one size, not {shape} and others")
        self._shape = shape
        self._parameters = parameters
        reference = references[0] if len(references) == 1 else np.median(np.stack(references), axis=0).astype(np.uint8)
        self._reference = working_image(reference)
        self._light = capped(self._reference)
        height, width = self._light.shape[:2]
        half = resized(self._light, (-(-width // _FINE_STEP), -(-height // _FINE_STEP)))
        self._evening = evening(half)
        self._light_levels = float(np.sqrt(np.mean(self._light**2)))
        self._drift = DriftModel(self._reference)
        self._crumbs = Crumbs(self._light)
        sighted = (self._reference < SATURATED_LEVEL).all(axis=2, keepdims=True)
        self._sighted = np.repeat(sighted, 3, axis=2).astype(np.float32)
        self._least_bend = _lit(self._light) * parameters.least_bend * PRINTED_LONG_SIDE_PX / max(self._reference.shape)

    def measure(self, image: Image, on_stage: StageSink | None = None) -> Contact:
        """Find the contact in an image.

        Args:
            image: shape (height, width, 3), dtype uint8, BGR, of the references' size.
            on_stage: gets the pictures named in `stages`.

        Raises:
            ValueError: the image's shape or dtype is not the references'.
        """
        seen = self._look(image)
        sure = seen.gate > _SURE_GATE
        if self._parameters.contacts == "several":
            candidates = separate_candidates(seen.bend, seen.threshold)
        else:
            candidates = body_candidates(seen.moved, seen.bend, seen.threshold)
        found = self._outlines(seen, candidates.regions, sure=sure)
        mask = self._mask(found)
        if on_stage:
            pictures.emit(
                on_stage,
                self.stages,
                difference=capped(seen.work) - self._light,
                change=seen.change,
                bend=seen.bend,
                candidates=candidates,
                threshold=seen.threshold,
                edges=[outline.edge for outline in found],
                mask=mask,
            )
        flags, confidence = self._judge(seen.work, seen.drift, mask, found, seen.gate)
        return contact_from_mask(
            mask,
            flags,
            confidence=confidence,
            gate=seen.gate,
            drift_levels=seen.drift.strength_levels,
        )

    def bending(self, image: Image) -> tuple[FloatImage, float]:
        """How much the gel bends at half the working size, and from how much on contact is looked for.

        Args:
            image: as for `measure`.

        Returns:
            Shape (height, width) and the gate's threshold, grey levels per pixel of the working image.

        Raises:
            ValueError: as `measure`.
        """
        seen = self._look(image)
        return seen.bend, seen.threshold

    def _look(self, image: Image) -> "_Seen":
        if image.shape != self._shape or image.dtype != np.uint8:
            raise ValueError(
                f"image {image.shape} {image.dtype} must be uint8 and of the reference's shape {self._shape}"
            )
        work = working_image(image)
        height, width = work.shape[:2]
        difference = capped(work)
        difference -= self._light
        quarter = resized(difference, (-(-width // _COARSE_STEP), -(-height // _COARSE_STEP)))
        drift = self._drift.fit(quarter, quiet(bending(quarter, _COARSE_STEP), self._least_bend))
        change = difference - drift.levels
        change *= self._sighted
        calm = quiet(bending(without_bands(quarter), _COARSE_STEP), self._least_bend)
        fits = resized(drift.background, (calm.shape[1], calm.shape[0]))
        calm *= resized(self._crumbs.clean, (calm.shape[1], calm.shape[0]))
        change = self._crumbs.bridged(without_streaks(change, np.minimum(calm, _LEAST_TRUST + fits)))
        half = resized(change, (-(-width // _FINE_STEP), -(-height // _FINE_STEP)))
        background = resized(drift.background, (half.shape[1], half.shape[0]))
        bend = bending(half, _FINE_STEP)
        noise = noise_of(bend, background)
        threshold = max(self._parameters.gate_ratio * noise, self._least_bend)
        moved = movement(half, background, self._evening, bend)
        if bend.max() <= threshold and has_moved_widely(moved):
            threshold *= _GATE_OF_WIDE
        return _Seen(work, drift, change, half, moved, bend, threshold)

    def _outlines(self, seen: "_Seen", candidates: list[Mask], *, sure: bool) -> list[Outline]:
        """The outlines that the image supports, or any where contact is sure."""
        found: list[Outline] = []
        one = self._parameters.contacts == "one"
        height, width = seen.change.shape[:2]
        smallest_px = self._parameters.smallest_contact_px * height * width / PRINTED_IMAGE_PX
        for candidate in candidates:
            if found and one:
                break
            others = None if one else sum((other for other in candidates if other is not candidate), 0 * candidate)
            body = find_body(seen.moved, candidate, others)
            if body is None:
                continue
            smooth = denoised(seen.change, seen.half, body.radius_px * width / candidate.shape[1])
            length = resized(length_of(smooth), (width, height))
            outline = find_outline(length, body, seen.drift.background, self._parameters.edge_stiffness)
            if cv2.countNonZero(outline.inside) < smallest_px or _one_sided(smooth, outline, sure=sure):
                continue
            support = _LEAST_SUPPORT if outline.edge.seen.all() else _LEAST_SUPPORT_CUT
            if sure or outline.confidence >= support:
                found.append(outline)
        return found

    def _mask(self, outlines: list[Outline]) -> Mask:
        height, width = self._shape[:2]
        if len(outlines) == 1:
            return outlines[0].drawn(height, width)
        mask = np.zeros((height, width), np.uint8)
        for outline in outlines:
            mask |= outline.drawn(height, width)
        return mask

    def _judge(
        self, work: Image, drift: Drift, mask: Mask, found: list[Outline], gate: float
    ) -> tuple[frozenset[Flag], float]:
        """The flags, and the weakest area's confidence; without an area 1 to 0 as the gate opens."""
        flags: set[Flag] = set()
        if (
            drift.strength_levels > _FOREIGN_DRIFT_SHARE * self._light_levels
            or drift.spread_levels >= SPREAD_CAP_LEVELS
        ):
            flags.add(Flag.REFERENCE_MISMATCH)
        inside = cv2.resize(mask, (work.shape[1], work.shape[0]), interpolation=cv2.INTER_NEAREST) > 0
        blue, green, red = cv2.split(work)
        saturated = cv2.max(cv2.max(blue, green), red) >= SATURATED_LEVEL
        if np.mean(saturated[inside] if inside.any() else saturated) > _SATURATED_SHARE:
            flags.add(Flag.SATURATED)
        if not found and gate > 1:
            flags.add(Flag.UNDECIDED)
        untouched = min(1.0, _SURE_GATE * max(0.0, 1.0 - gate))
        confidence = min((_sureness(outline, gate) for outline in found), default=untouched)
        if Flag.REFERENCE_MISMATCH in flags:
            confidence *= 0.5
        if confidence < self._parameters.least_confidence:
            flags.add(Flag.LOW_CONFIDENCE)
        return frozenset(flags), confidence


class _Seen(NamedTuple):
    """One frame without drift, before contacts are looked for."""

    work: Image
    drift: Drift
    change: FloatImage
    half: FloatImage
    """The change averaged down to the bending's size."""
    moved: Movement
    bend: FloatImage
    threshold: float

    @property
    def gate(self) -> float:
        """The strongest bending over the gate's threshold."""
        return float(self.bend.max()) / self.threshold


def _lit(light: FloatImage) -> float:
    """The share of the colours that have light: one whose LED is dead adds nothing to what bends."""
    means = np.asarray(cv2.mean(light)[:3])
    return float(np.mean(means > _LEAST_LIGHT * means.max()))


def _sureness(outline: Outline, gate: float) -> float:
    """An outline's confidence; drift at the border looks like a contact that it cuts, and opens the gate a little."""
    if outline.edge.seen.all():
        return outline.confidence
    return outline.confidence * min(1.0, (gate - 1) / (_SURE_GATE - 1))


def _one_sided(change: FloatImage, outline: Outline, *, sure: bool) -> bool:
    """Whether the change inside is of one colour: a contact's slopes point all ways and cancel, dirt's do not.

    Not asked of a sure contact that the border cuts: its other slopes may lie outside.
    """
    if sure and not outline.edge.seen.all():
        return False
    size = (change.shape[1], change.shape[0])
    inside = cv2.resize(outline.inside, size, interpolation=cv2.INTER_NEAREST)
    mean, deviation = cv2.meanStdDev(change, mask=inside)
    of_the_mean = float((mean**2).sum())
    return of_the_mean > _ONE_SIDED * (of_the_mean + float((deviation**2).sum()))

"""The station's own method: the contact's edge, under drift, streaks and weak light.

Stages: signed difference to the reference; drift and streaks taken off; bending and the gate; clusters of the bending,
as many as the data ask for; for each region the edge where the change falls off most steeply. Where the gate stays
shut, touches lighter than drift are looked for. `docs/robust.md` explains each with its reasons.
"""

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from station.settings.segmentation import RobustParameters
from station.vision import pictures, weak_contact
from station.vision.background import SPREAD_CAP_LEVELS, Drift, DriftModel, without_bands, without_streaks
from station.vision.candidates import Candidates, around, body_candidates, disc, separate_candidates
from station.vision.contact import Contact, Flag, FloatImage, Image, Mask, StageSink, contact_from_mask
from station.vision.curvature import bending, noise_of, quiet
from station.vision.debris import Crumbs
from station.vision.edge_signal import denoised, length_of
from station.vision.outline import Outline, find_outline
from station.vision.region import Body, Movement, evening, find_body, has_moved_widely, movement
from station.vision.weak_contact import LightTouch
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
_FIRM_GATE = 10.0
"""Drift has not been seen to open the gate so far."""
_LIGHT_LEAST_BEND = 0.3
"""Of the gate's threshold, at a light touch too: what misleads one of the two seldom misleads the other."""
_LIGHT_REACHES_PX, _REACHED = (18, 36, 72), 0.9
"""How far a light touch may reach, at half the working size; the next where its body fills the one before."""
_GATE_OF_WIDE = 0.6
"""Of the gate's threshold, where so much has moved that the background's bending is the skirt's."""


class RobustMethod:
    """The robust measurement against one or several reference images."""

    stages: tuple[str, ...] = (
        "difference",
        "amplified",
        "denoised",
        "bending",
        "slopes",
        "clustered",
        "edge",
        "segmented",
    )

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
        self._lit = _lit(self._light)
        self._crumbs = Crumbs(self._light)
        halves = [resized(capped(working_image(one)), (half.shape[1], half.shape[0])) for one in references]
        mean = np.asarray(np.mean(halves, axis=0), np.float32)
        self._touch = LightTouch(mean, self._lit, self._crumbs.clean)
        sighted = (self._reference < SATURATED_LEVEL).all(axis=2, keepdims=True)
        self._sighted = np.repeat(sighted, 3, axis=2).astype(np.float32)
        least_bend = float(np.mean(self._lit)) * parameters.least_bend
        self._least_bend = least_bend * PRINTED_LONG_SIDE_PX / max(self._reference.shape)

    def measure(self, image: Image, on_stage: StageSink | None = None, previous: Contact | None = None) -> Contact:
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
        found = self._outlines(seen, candidates, sure=sure)
        are_sure = [_sureness(one, seen.gate) >= self._parameters.least_confidence for one in found]
        if not found or (seen.gate < _FIRM_GATE and not all(are_sure)):
            response = self._response(seen.work)
            found = [one for one, is_sure in zip(found, are_sure, strict=True) if is_sure or self._shows(one, response)]
            if not found and (place := self._touched_at(seen, response)):
                seen, candidates = seen._replace(touched_at=place), around(place, seen.moved)
                found = self._outlines(seen, candidates, sure=sure)
        mask = self._mask(found)
        if on_stage:
            pictures.emit(
                on_stage,
                self.stages,
                difference=capped(seen.work) - self._light,
                change=seen.change,
                bend=seen.bend,
                threshold=seen.threshold,
                response=self._response(seen.work),
                response_gate=weak_contact.gate(self._parameters.gate_ratio),
                candidates=candidates,
                edges=[outline.edge for outline in found],
                mask=mask,
            )
        flags, confidence = self._judge(seen, mask, found)
        return contact_from_mask(
            mask,
            flags,
            confidence=confidence,
            gate=seen.gate,
            drift_levels=seen.drift.strength_levels,
            is_light=seen.touched_at is not None,
        )

    def light_touch(self, image: Image) -> tuple[FloatImage, float]:
        """How far the gel's slopes stand out of the frame's noise, and from how much on a light touch is looked for.

        Args:
            image: as for `measure`.

        Returns:
            Shape (height, width) at half the working size, as `LightTouch.response`, and the gate's threshold.

        Raises:
            ValueError: as `measure`.
        """
        return self._response(self._look(image).work), weak_contact.gate(self._parameters.gate_ratio)

    def _response(self, work: Image) -> FloatImage:
        height, width = self._crumbs.clean.shape
        return self._touch.response(resized(capped(work), (width, height)))

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

    def _touched_at(self, seen: "_Seen", response: FloatImage) -> tuple[int, int] | None:
        """Where a touch too light for the gate lies, or one that drift hides: x and y at half the working size."""
        place = self._touch.place(response, self._parameters.gate_ratio)
        if place and seen.bend[self._touch.near(place)].max() > _LIGHT_LEAST_BEND * seen.threshold:
            return place
        return None

    def _shows(self, outline: Outline, response: FloatImage) -> bool:
        """Whether the place of an outline shows more than drift."""
        size = (response.shape[1], response.shape[0])
        place = cv2.resize(outline.inside, size, interpolation=cv2.INTER_NEAREST)
        return self._touch.shows(np.asarray(place, np.uint8), response, self._parameters.gate_ratio)

    def _outlines(self, seen: "_Seen", candidates: Candidates, *, sure: bool) -> list[Outline]:
        """The outlines that the image supports, or any where contact is sure or a light touch was seen."""
        found: list[Outline] = []
        one = self._parameters.contacts == "one"
        height, width = seen.change.shape[:2]
        smallest_px = self._parameters.smallest_contact_px * height * width / PRINTED_IMAGE_PX
        for candidate in candidates.regions:
            if found and one:
                break
            body = _body(seen, candidate, None if one else candidates.regions)
            if body is None:
                continue
            smooth = denoised(seen.change, seen.half, body.radius_px * width / candidate.shape[1])
            length = resized(length_of(smooth), (width, height))
            outline = find_outline(length, body, seen.drift.background, self._parameters.edge_stiffness)
            if cv2.countNonZero(outline.inside) < smallest_px or _one_sided(smooth, outline, sure=sure):
                continue
            support = _LEAST_SUPPORT if outline.edge.seen.all() else _LEAST_SUPPORT_CUT
            if sure or seen.touched_at or outline.confidence >= support:
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

    def _judge(self, seen: "_Seen", mask: Mask, found: list[Outline]) -> tuple[frozenset[Flag], float]:
        """The flags, and the weakest area's confidence; without an area 1 to 0 as the gate opens."""
        flags: set[Flag] = set()
        work, drift = seen.work, seen.drift
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
        if not found and (seen.gate > 1 or seen.touched_at):
            flags.add(Flag.UNDECIDED)
        untouched = 0.0 if seen.touched_at else min(1.0, _SURE_GATE * max(0.0, 1.0 - seen.gate))
        confidence = min((_sureness(outline, seen.gate) for outline in found), default=untouched)
        if Flag.REFERENCE_MISMATCH in flags or seen.touched_at:
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
    touched_at: tuple[int, int] | None = None
    """Where a touch lies that is too light for the gate: x and y at the change's half size."""

    @property
    def gate(self) -> float:
        """The strongest bending over the gate's threshold."""
        return float(self.bend.max()) / self.threshold


def _lit(light: FloatImage) -> npt.NDArray[np.bool_]:
    """Which colours have light, shape (3,): one whose LED is dead adds nothing to what bends."""
    means = np.asarray(cv2.mean(light)[:3])
    return np.asarray(means > _LEAST_LIGHT * means.max())


def _sureness(outline: Outline, gate: float) -> float:
    """An outline's confidence; drift at the border looks like a contact that it cuts, and opens the gate a little."""
    if outline.edge.seen.all():
        return outline.confidence
    return outline.confidence * float(np.clip((gate - 1) / (_SURE_GATE - 1), 0, 1))


def _body(seen: _Seen, candidate: Mask, several: list[Mask] | None) -> Body | None:
    """The body that a candidate belongs to.

    Args:
        seen: the frame.
        candidate: where the body has been seen.
        several: all candidates, where each may be a body of its own.
    """
    if seen.touched_at is None:
        others = None if several is None else sum((one for one in several if one is not candidate), 0 * candidate)
        return find_body(seen.moved, candidate, others)
    body = None
    for reach_px in _LIGHT_REACHES_PX:
        beyond = 1 - disc(candidate.shape, seen.touched_at, reach_px)
        body = find_body(seen.moved, candidate, beyond)
        if body is None or body.radii_px.max() < _REACHED * reach_px:
            break
    return body


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

"""Robust method: the contact's edge under drift, streaks and weak light, as one pipeline of stages.

`RobustMethod.pipeline` has the stages in their order. One `State` is passed along; each stage reads what is there and
adds its own part. `docs/robust.md` explains each with its reasons; `docs/robust-constants.md` has what each one
contributes.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import cv2
import numpy as np

from station.settings.segmentation import RobustParameters
from station.vision import pictures
from station.vision.background import Background, BackgroundModel, Coefficients, destriped
from station.vision.candidates import Candidates, around, body_candidates, disc, separate_candidates
from station.vision.changed_area import area_agreement, changed, growth_agreement
from station.vision.constants import CONSTANTS, Constants
from station.vision.contact import Contact, FloatImage, Image, Mask, StageSink, contact_from_mask
from station.vision.curvature import curvature, curvature_noise, first_background
from station.vision.debris import Debris
from station.vision.outline import Outline, find_outline
from station.vision.reference_check import ReferenceCheck
from station.vision.region import (
    Movement,
    Region,
    find_region,
    flat_field_correction,
    has_moved_widely,
    movement,
)
from station.vision.weak_contact import WeakContactDetector
from station.vision.working import (
    PRINTED_IMAGE_PX,
    PRINTED_LONG_SIDE_PX,
    SATURATED_LEVEL,
    clipped,
    resized,
    working_image,
)
from station.vocabulary import Flag

_COARSE_STEP, _FINE_STEP = 4, 2
"""By how much the fields of the first guess and of all else are smaller than the working image."""
_WEAK_REACHES_PX, _REACHED = (18, 36, 72), 0.9
"""How far a weak contact may reach, at half the working size; the next where its region fills the one before."""
_WEAK_DOUBT = 0.5
"""Of a weak contact's confidence: its area is rough, so that it is hardly ever judged."""
_CLEAR_GATE = 10.0
"""The strongest curvature over the threshold from which doubtful outlines are not checked for support. An estimate."""

STAGES = (
    "reference check",
    "background",
    "destriping",
    "debris",
    "flat field",
    "weak contact",
    "support",
    "one colour",
    "texture",
    "following",
    "witness",
)
"""Stages that can be left out, to measure what each one contributes."""


class Trace(NamedTuple):
    """Data that one step of a press hands on to the next."""

    coefficients: Coefficients | None
    """Of the background model; None where the step itself shows nothing."""
    floor: Mask | None
    """The contact so far, at half the working size, 0 or 1; None before one is trusted or confirmed."""
    floor_load_levels: float
    """How much the whole image differed then."""
    contact: Mask
    """The contact at the last step, trusted or not, at half the working size, 0 or 1."""
    least: Mask
    """What was returned there: the contact, with what a doubtful step takes over; at the input's size, 0 or 255."""
    load_levels: float
    """How much the whole image differed there."""
    changed_px: int
    """The changed area at the last step, px of half the working size."""
    textured: bool | None
    """Whether the body is textured, as last seen with enough background to know; None before."""


@dataclass(slots=True)
class State:
    """One frame on its way through the pipeline."""

    work: Image
    """The frame at the working size, shape (height, width, 3), dtype uint8."""
    frame: FloatImage
    """Cut off where it saturates, at half the working size, shape (height, width, 3), grey levels."""
    difference: FloatImage
    """Frame minus reference, shape of `frame`; afterwards without its background: the change."""
    before: Trace | None
    """Of the press's last step; None of a single image, and once the body has been let go."""
    quarter: FloatImage = field(init=False)
    """The difference averaged down to a quarter of the working size."""
    load_levels: float = 0.0
    """Root mean square of the difference: contact, and all else that the load changes."""
    calm: FloatImage = field(init=False)
    """First guess of the background, at a quarter of the working size, 0 to 1."""
    background: Background = field(init=False)
    moved: Movement = field(init=False)
    threshold: float = field(init=False)
    """The detection threshold of the curvature, grey levels per pixel."""
    gate: float = field(init=False)
    """The strongest curvature over the detection threshold."""
    changed: Mask = field(init=False)
    """The witness, at half the working size, 0 or 1."""
    floor: Mask | None = None
    """What has been in contact since an earlier step, at half the working size, 0 or 1."""
    candidates: Candidates = field(init=False)
    weak_at: tuple[int, int] | None = None
    """Where a weak contact lies: x and y at half the working size."""
    outlines: list[Outline] = field(default_factory=list)
    mask: Mask = field(init=False)
    """At the input's size, 0 or 255."""
    contact: Mask = field(init=False)
    """What this step itself shows of it, with the floor, at half the working size, 0 or 1."""
    contact_px: int = 0
    """Its area as drawn, in pixels of half the working size; `contact` has only those that it covers wholly."""
    flags: set[Flag] = field(default_factory=set)
    confidence: float = 0.0
    agreed: float = 1.0
    """How far the step's frames agree, 0 to 1."""
    firm_only: bool = False
    """Whether the search for weak contacts is left out."""


class RobustMethod:
    """The robust measurement against a reference image.

    Args:
        reference: the untouched gel, shape (height, width, 3), dtype uint8, BGR; of several frames their median.
        parameters: the recipe's.
        constants: all other numbers.
        without: stages of `STAGES` to leave out.

    Raises:
        ValueError: the reference is no such image, or there is no such stage.
    """

    stages: tuple[str, ...] = (
        "difference",
        "amplified",
        "denoised",
        "curvature",
        "slopes",
        "level",
        "edge",
        "segmented",
    )

    def __init__(
        self,
        reference: Image,
        parameters: RobustParameters,
        constants: Constants = CONSTANTS,
        without: frozenset[str] = frozenset(),
    ) -> None:
        shape = reference.shape
        if reference.dtype != np.uint8 or reference.ndim != 3 or shape[2] != 3:
            raise ValueError(f"reference {shape} {reference.dtype} must be a uint8 image (height, width, 3)")
        if unknown := without.difference(STAGES):
            raise ValueError(f"no such stage: {', '.join(sorted(unknown))}; there are {', '.join(STAGES)}")
        self._shape, self._parameters, self._constants, self._without = shape, parameters, constants, without
        self._reference = working_image(reference)
        self._model = BackgroundModel(self._reference, constants)
        light = clipped(self._reference)
        height, width = light.shape[:2]
        self._half = (-(-width // 2), -(-height // 2))
        self._quarter = (-(-self._half[0] // 2), -(-self._half[1] // 2))
        self._light = resized(light, self._half)
        self._check = ReferenceCheck(self._light)
        self._light_levels = float(np.sqrt(np.mean(self._light**2)))
        self._flat_field = flat_field_correction(self._light, constants)
        if "flat field" in without:
            self._flat_field = np.ones_like(self._flat_field)
        means = np.asarray(cv2.mean(light)[:3])
        lit = np.asarray(means > constants.lit_share * means.max())  # a dead LED's colour adds nothing to what curves
        self._debris = Debris(light)
        self._clean = resized(self._debris.clean, self._quarter)
        self._weak = WeakContactDetector(self._light, lit, self._debris.clean, constants, parameters.gate_ratio)
        unsaturated = np.asarray((self._reference < SATURATED_LEVEL).all(axis=2), np.float32)
        # Where the reference is cut off, its difference from a frame does not show the gel's slope.
        self._unsaturated = cv2.merge([resized(unsaturated, self._half)] * 3)
        # The response sums up the colours: without light in one of them the same curvature shows less.
        least = float(np.mean(lit)) * parameters.least_bend
        # The recipe's slope is per pixel of the printed size: a larger pixel sees more change.
        self._least_curvature = least * PRINTED_LONG_SIDE_PX / max(self._reference.shape)

    @property
    def pipeline(self) -> tuple[Callable[[State], None], ...]:
        """The stages in their order."""
        return (
            self._check_reference,
            # Before the fit: what was in contact is no background, and a body let go is measured as a single image.
            self._follow,
            self._subtract_background,
            self._destripe,
            self._bridge_debris,
            self._respond,
            self._see_what_changed,
            self._find_candidates,
            self._outline_candidates,
            self._drop_unsupported,
            self._find_weak_contact,
            self._flag_lost_edge,
            self._draw,
            self._keep_least,
            self._judge,
        )

    def measure(
        self,
        image: Image,
        on_stage: StageSink | None = None,
        previous: Contact | None = None,
        agreed: float = 1.0,
        *,
        firm_only: bool = False,
    ) -> Contact:
        """See `Method.measure`; a firm contact is the same with `firm_only`.

        Raises:
            ValueError: the image's shape or dtype is not the reference's.
        """
        state = self._start(image, previous)
        state.agreed, state.firm_only = agreed, firm_only
        # The stages change the difference in place.
        difference = state.difference.copy() if on_stage else state.difference
        for stage in self.pipeline:
            stage(state)
        if on_stage:
            self._show(on_stage, state, difference)
        return contact_from_mask(
            state.mask,
            frozenset(state.flags),
            confidence=state.confidence,
            gate=state.gate,
            drift_levels=state.background.strength_levels,
            is_light=state.weak_at is not None,
            changed_area_px=self._at_input_size(cv2.countNonZero(state.changed), state),
            trace=self._trace(state),
        )

    def weak_response(self, image: Image) -> tuple[FloatImage, float]:
        """The weak-contact detector's response to an image, and its threshold.

        Returns:
            Shape (height, width) at half the working size, as `WeakContactDetector.response`, and the threshold.

        Raises:
            ValueError: as `measure`.
        """
        response = self._weak.response(self._start(image, None).frame)
        return response.field, self._weak.threshold * response.compression

    def _start(self, image: Image, previous: Contact | None) -> State:
        if image.shape != self._shape or image.dtype != np.uint8:
            raise ValueError(
                f"image {image.shape} {image.dtype} must be uint8 and of the reference's shape {self._shape}"
            )
        before = previous.trace if previous is not None and "following" not in self._without else None
        work = working_image(image)
        frame = resized(clipped(work), self._half)
        return State(work, frame, frame - self._light, before if isinstance(before, Trace) else None)

    # The stages

    def _check_reference(self, state: State) -> None:
        """Flag a frame of another sensor than the reference's."""
        if "reference check" not in self._without and self._check.mismatch(state.frame) > 1:
            state.flags.add(Flag.REFERENCE_MISMATCH)

    def _subtract_background(self, state: State) -> None:
        """Fit the background where the gel hardly curves and nothing touched before, and take it off."""
        state.calm = first_background(
            curvature(state.quarter, _COARSE_STEP, self._constants), self._least_curvature, self._constants
        )
        before = state.before
        if state.floor is not None:
            state.calm *= 1 - resized(state.floor.astype(np.float32), self._quarter)
        state.background = self._model.fit(state.quarter, state.calm, None if before is None else before.coefficients)
        if "background" not in self._without:
            state.difference -= state.background.levels
        # After the model is taken off: blanked before, a saturated place would show the model's own levels.
        state.difference *= self._unsaturated

    def _destripe(self, state: State) -> None:
        """Take rows' and columns' noise off, by the places without contact."""
        if "destriping" in self._without:
            return
        # Debris is bridged later: in the difference it still stands out, and it is no offset of a line.
        trusted = state.calm * self._clean
        state.difference = destriped(state.difference, trusted, self._constants)

    def _bridge_debris(self, state: State) -> None:
        """Fill what debris hides or feigns."""
        if "debris" not in self._without:
            state.difference = self._debris.bridged(state.difference)

    def _respond(self, state: State) -> None:
        """Compute the curvature response and the threshold from which on something touches."""
        response = curvature(state.difference, _FINE_STEP, self._constants)
        noise = curvature_noise(response, state.background)
        state.threshold = max(self._parameters.gate_ratio * noise, self._least_curvature)
        state.moved = movement(state.difference, state.background, self._flat_field, response)
        # A large smooth body curves the gel evenly and leaves its halo for background.
        strongest = float(response.max())
        if strongest <= state.threshold and has_moved_widely(state.moved, self._constants):
            state.threshold *= self._constants.wide_threshold
        state.gate = strongest / state.threshold

    def _see_what_changed(self, state: State) -> None:
        """Find where the image has changed at all, contact or halo."""
        state.changed = changed(state.moved, state.background.spread_levels, self._constants)

    def _follow(self, state: State) -> None:
        """Take over what was in contact at the last trusted step; once the body has been let go the press is over."""
        state.quarter = resized(state.difference, self._quarter)
        state.load_levels = float(np.sqrt(np.mean(np.square(state.quarter))))
        before = state.before
        if before is None or before.floor is None or self._parameters.contacts == "several":
            return
        if state.load_levels < self._constants.released_share * before.floor_load_levels:
            state.before = None
        else:
            # An edge is found outside the floor: without room for it a body at rest would grow from step to step.
            within = np.asarray(cv2.erode(before.floor, np.ones((3, 3), np.uint8)), np.uint8)
            state.floor = within if within.any() else before.floor

    def _find_candidates(self, state: State) -> None:
        """Find where contacts may lie."""
        if self._parameters.contacts == "several":
            state.candidates = separate_candidates(state.moved.curvature, state.threshold)
            return
        found = body_candidates(state.moved, state.threshold, self._constants)
        if state.floor is not None:  # the body is where it was, and whatever joins it there is its own
            joined = [one for one in found.regions if (one & state.floor).any()]
            start = np.bitwise_or.reduce([state.floor, *joined])
            found = found._replace(regions=[np.asarray(start, np.uint8)])
        state.candidates = found

    def _outline_candidates(self, state: State) -> None:
        """Outline the candidates that the image supports; of one body the first."""
        one = self._parameters.contacts == "one"
        regions = state.candidates.regions
        for candidate in regions:
            if state.outlines and one:
                break
            others = None if one else sum((other for other in regions if other is not candidate), 0 * candidate)
            body = self._region(state, candidate, others)
            if body is not None and (outline := self._outlined(state, body)) is not None:
                state.outlines.append(outline)

    def _drop_unsupported(self, state: State) -> None:
        """Drop doubtful outlines within which no slope exceeds the noise: they are drift."""
        doubtful = [one for one in state.outlines if self._confidence(one, state) < self._parameters.least_confidence]
        if not doubtful or state.floor is not None or state.gate >= _CLEAR_GATE or "support" in self._without:
            return
        response = self._weak.response(state.frame)
        size = (response.field.shape[1], response.field.shape[0])
        places = [cv2.resize(one.inside, size, interpolation=cv2.INTER_NEAREST) for one in doubtful]
        dropped = [
            one
            for one, place in zip(doubtful, places, strict=True)
            if not self._weak.supports(np.asarray(place, np.uint8), response)
        ]
        state.outlines = [one for one in state.outlines if one not in dropped]

    def _find_weak_contact(self, state: State) -> None:
        """Search for a contact below the detection threshold where nothing was found."""
        if state.outlines or state.firm_only or "weak contact" in self._without:
            return
        # Of the frame, not of the change: the robust fit leaves edges, to which the detector would respond.
        place = self._weak.place(self._weak.response(state.frame))
        least = self._constants.weak_least_curvature * state.threshold
        if place is None or state.moved.curvature[self._weak.near(place)].max() <= least:
            return
        state.weak_at = place
        state.candidates = around(place, state.moved, self._constants)
        start, body = state.candidates.regions[0], None
        for reach_px in _WEAK_REACHES_PX:  # no further than its own region fills, since drift is all around it
            near = disc(start.shape, place, reach_px)
            body = self._region(state, start & near, 1 - near)
            if body is None or body.radii.max() < _REACHED * reach_px:
                break
        if body is not None and (outline := self._outlined(state, body)) is not None:
            state.outlines.append(outline)

    def _flag_lost_edge(self, state: State) -> None:
        """Flag the area as a lower bound where the edge of a followed contact is lost."""
        if state.floor is None:
            return
        sure = [self._confidence(one, state) >= self._parameters.least_confidence for one in state.outlines]
        if not sure or not all(sure):
            state.flags.add(Flag.LOWER_BOUND)

    def _draw(self, state: State) -> None:
        """Draw the contacts at the input's size."""
        height, width = self._shape[:2]
        if len(state.outlines) == 1:
            state.mask = state.outlines[0].drawn(height, width)
        else:
            state.mask = np.zeros((height, width), np.uint8)
            for outline in state.outlines:
                state.mask |= outline.drawn(height, width)
        if state.floor is not None and state.before is not None and state.before.floor is not None:
            # The floor whole, not the one a pixel within it: the area of a body at rest must not shrink.
            floor = cv2.resize(state.before.floor, (width, height), interpolation=cv2.INTER_NEAREST)
            state.mask |= np.asarray(floor * 255, np.uint8)
        shape = state.changed.shape
        # Whole pixels only, so that what is handed on lies within the mask.
        covered = cv2.resize(state.mask, (shape[1], shape[0]), interpolation=cv2.INTER_AREA)
        state.contact = np.asarray(covered == 255, np.uint8)
        state.contact_px = round(cv2.countNonZero(state.mask) * state.contact.size / state.mask.size)

    def _keep_least(self, state: State) -> None:
        """Return at least what the step before did where no edge is trusted: compression only rises."""
        before, least = state.before, self._parameters.least_confidence
        state.confidence = self._outlines_confidence(state)
        if before is None or not cv2.countNonZero(before.least) or self._parameters.contacts == "several":
            return
        if state.confidence >= least or state.load_levels < self._constants.released_share * before.load_levels:
            return
        shown_px = round(cv2.countNonZero(state.mask) * state.changed.size / state.mask.size)
        # An outline that hardly holds any change, where hardly anything curves, has been drawn around nothing. A soft
        # fruit's holds little change too: the flat middle of its contact is most of it.
        drawn = state.gate > 1 or cv2.countNonZero(state.changed) >= self._constants.witness_least * shown_px
        held = state.mask | before.least if drawn else before.least
        # A faint body's outline may not grow with the compression; what has changed does, and makes the areas differ.
        if not drawn or np.array_equal(held, before.least):
            height, width = self._shape[:2]
            changed = cv2.resize(state.changed, (width, height), interpolation=cv2.INTER_NEAREST)
            held = held | np.asarray(changed * 255, np.uint8)
        # Only what is returned: `contact` stays what this step shows, so that nothing of this enters the floor.
        state.mask = held
        state.flags.add(Flag.LOWER_BOUND)

    def _outlines_confidence(self, state: State) -> float:
        """The weakest outline's confidence, less where the changed area disagrees; 0 without an outline."""
        confidence = min((self._confidence(one, state) for one in state.outlines), default=0.0)
        if "witness" not in self._without:
            confidence *= self._agreement(state, cv2.countNonZero(state.mask))
        return confidence * state.agreed

    def _judge(self, state: State) -> None:
        """Set the flags, and the weakest contact's confidence; without a contact 1 to 0 as the threshold is reached."""
        p, flags, work = self._constants, state.flags, state.work
        if state.background.strength_levels > p.most_drift_share * self._light_levels:
            flags.add(Flag.REFERENCE_MISMATCH)
        if work.max() >= SATURATED_LEVEL and _saturated_share(work, state.mask) > p.saturated_share:
            flags.add(Flag.SATURATED)
        touched = bool(state.outlines) or Flag.LOWER_BOUND in flags
        if not touched and (state.gate > 1 or state.weak_at):
            flags.add(Flag.UNDECIDED)
        if not touched:
            state.confidence = 0.0 if state.weak_at else min(1.0, p.sure_gate * max(0.0, 1.0 - state.gate))
            state.confidence *= state.agreed
        if state.weak_at:
            state.confidence *= _WEAK_DOUBT
        moved = touched and state.floor is None and self._debris.may_be(state.gate, state.contact_px)
        if Flag.REFERENCE_MISMATCH in flags or (moved and "debris" not in self._without):
            state.confidence = 0.0
        if state.confidence < self._parameters.least_confidence:
            flags.add(Flag.LOW_CONFIDENCE)

    # What the stages share

    def _region(self, state: State, start: Mask, others: Mask | None) -> Region | None:
        known = None
        if "texture" in self._without:
            known = False
        # With hardly any background the change's directions hardly show skin: an earlier step's finding is used.
        elif state.before is not None and state.background.share < self._constants.known_share / 2:
            known = state.before.textured
        return find_region(state.moved, start, self._constants, others, state.floor, texture=known)

    def _outlined(self, state: State, body: Region) -> Outline | None:
        """The outline of a region, or None where the image does not support it."""
        p = self._constants
        sure, stiffness = state.gate > p.sure_gate, self._parameters.edge_stiffness
        outline = find_outline(state.moved.length, body, state.background, stiffness, p, state.floor)
        smallest_px = self._parameters.smallest_contact_px * outline.inside.size / PRINTED_IMAGE_PX
        if cv2.countNonZero(outline.inside) < smallest_px:
            return None
        # Something touches already: an outline with little support becomes a lower bound, and is not dropped.
        if state.floor is not None:
            return outline
        if self._one_colour(state, outline, sure=sure):
            return None
        supported = sure or state.weak_at is not None or self._confidence(outline, state) >= p.support_least
        return outline if supported else None

    def _one_colour(self, state: State, outline: Outline, *, sure: bool) -> bool:
        """Return whether the change inside has one colour: a contact's slopes point all ways and cancel, dirt's do not.

        False for a sure contact that the border cuts: its other slopes may be outside.
        """
        if "one colour" in self._without or (sure and not outline.edge.seen.all()):
            return False
        change = state.difference
        inside = cv2.resize(outline.inside, (change.shape[1], change.shape[0]), interpolation=cv2.INTER_NEAREST)
        mean, deviation = cv2.meanStdDev(change, mask=inside)
        power = float((mean**2).sum())
        return power > self._constants.one_colour * (power + float((deviation**2).sum()))

    def _confidence(self, outline: Outline, state: State) -> float:
        """An outline's confidence, less where the border cuts it and the gel hardly curves: drift resembles that."""
        if outline.edge.seen.all() or state.floor is not None:
            return outline.confidence
        return outline.confidence * float(np.clip((state.gate - 1) / (self._constants.sure_gate - 1), 0, 1))

    def _agreement(self, state: State, contact_px: int) -> float:
        """Return the agreement of the changed area with the contact area, 0 to 1."""
        contact_px = round(contact_px * state.changed.size / (self._shape[0] * self._shape[1]))
        changed_px = cv2.countNonZero(state.changed)
        agreed = area_agreement(contact_px, changed_px, self._constants)
        if state.before is not None and (before_px := cv2.countNonZero(state.before.contact)):
            kept_px = cv2.countNonZero(state.contact)
            agreed *= growth_agreement((before_px, kept_px), (state.before.changed_px, changed_px))
        return agreed

    def _trace(self, state: State) -> Trace | None:
        if not cv2.countNonZero(state.mask):
            return None
        # A press begins with its first contact: what drifted before says little about its light.
        if not state.outlines and state.floor is None:
            return Trace(None, None, 0.0, state.contact, state.mask, state.load_levels, 0, None)
        before, background = state.before, state.background
        known = background.share >= self._constants.known_share / 2
        contact = state.contact
        known_before = None if before is None or state.floor is None else before.floor
        floor, load_levels = known_before, 0.0 if before is None else before.floor_load_levels
        if contact.any() and not state.weak_at and Flag.LOW_CONFIDENCE not in state.flags:
            # Together with what was known: each step may seem to shrink a little, and many must not add up.
            floor, load_levels = contact if known_before is None else contact | known_before, state.load_levels
        elif before is not None and self._confirms(contact, before.contact):
            floor = before.contact if floor is None else floor | before.contact
            load_levels = max(load_levels, state.load_levels)
        textured = None if before is None else before.textured
        if state.outlines and known:
            textured = state.outlines[0].textured
        # What is fitted with hardly any background would take in more of the contact from step to step.
        coefficients = background.coefficients if known or before is None else before.coefficients
        changed_px = cv2.countNonZero(state.changed)
        return Trace(coefficients, floor, load_levels, contact, state.mask, state.load_levels, changed_px, textured)

    def _confirms(self, contact: Mask, before: Mask) -> bool:
        """Return whether a contact covers nearly all of the last step's: one by chance does not."""
        area_px = cv2.countNonZero(before)
        return area_px > 0 and cv2.countNonZero(before & contact) >= self._constants.confirmed_share * area_px

    def _at_input_size(self, half_px: int, state: State) -> int:
        return round(half_px * self._shape[0] * self._shape[1] / state.changed.size)

    def _show(self, on_stage: StageSink, state: State, difference: FloatImage) -> None:
        response = self._weak.response(state.frame)
        pictures.emit(
            on_stage,
            self.stages,
            difference=difference,
            change=state.difference,
            curvature=state.moved.curvature,
            threshold=state.threshold,
            response=response.field,
            response_threshold=self._weak.threshold * response.compression,
            candidates=state.candidates,
            edges=[outline.edge for outline in state.outlines],
            mask=state.mask,
        )


def _saturated_share(image: Image, mask: Mask) -> float:
    """Return the saturated share, 0 to 1, of an image within a mask of any size, or of all of it for an empty mask."""
    blue, green, red = cv2.split(image)
    saturated = (cv2.max(cv2.max(blue, green), red) >= SATURATED_LEVEL).view(np.uint8)
    inside = cv2.resize(mask, (image.shape[1], image.shape[0]), interpolation=cv2.INTER_NEAREST)
    if (inside_px := cv2.countNonZero(inside)) == 0:
        return cv2.countNonZero(saturated) / saturated.size
    return cv2.countNonZero(cv2.bitwise_and(saturated, inside)) / inside_px

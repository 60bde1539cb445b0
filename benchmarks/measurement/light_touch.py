"""The lightest touch that the robust method finds on the twin, and what hides lighter ones."""

import itertools
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from measurement.on_the_twin import FRAMES_PER_S, FRAMES_PER_STEP, FRUITS, squeezed
from measurement.peers import PEER, contact_area_idea
from measurement.untouched import UNITS, untouched
from station.settings.segmentation import RobustParameters
from station.twin.contact import FruitOnGel, Pose
from station.twin.digit.press import PressOptions
from station.twin.digit.sensor import DigitSensor
from station.twin.fruit import draw_fruit
from station.twin.gel import Gel
from station.twin.squeeze import Squeeze
from station.vision.constants import CONSTANTS
from station.vision.contact import Image
from station.vision.median import median_image
from station.vision.robust import RobustMethod
from station.vision.step import mean_image

DETECTION_PLACES = ((240.0, 320.0), (120.0, 160.0), (360.0, 480.0), (120.0, 480.0), (360.0, 160.0))
DETECTION_UNITS = (None, 7)
DETECTION_SEED = 102_000
LIGHT_AREAS_MM2 = (1, 2, 3, 5, 10)
BOUND_DRAWS = 24
BOUND_COSINES = 6
"""What an observer's template leaves to drift: cosines up to this order, and each column's and row's mean."""

AVERAGED = ((FRAMES_PER_STEP, 5), (6, 15), (12, 31))
"""Frames a step and reference frames: the recipes', and more."""
GATE = CONSTANTS.weak_threshold
GATES = (6.0, 6.5, 6.9, 7.5, 8.5)
"""Of the light touches' response that are tried."""
UNTOUCHED_RADII = 2.5

Floats = npt.NDArray[np.float32]
Beside = tuple[Image, Image, npt.NDArray[np.bool_]]
"""Of a real press its reference, its image, and where in it nothing touches."""


class Light(NamedTuple):
    """One light contact: of which fruit, where and how large, and what was found."""

    kind: str
    fruit: tuple[int, Pose, int | None]
    """Its seed, its place and the sensor's unit."""
    area_mm2: int
    """The area meant."""
    closing_mm: float
    ratio: float
    """The area found over the truth's, 0 where none is."""
    response: float
    """The strongest of the light touches' response."""
    peer_found: bool
    """Whether PyTouch's contact area has any area."""

    @property
    def found(self) -> bool:
        """True if an area was found."""
        return self.ratio > 0


def light_contacts(frames_per_step: int, references: int) -> tuple[list[Light], int, int]:
    """Light contacts of each fruit at several places on several units.

    Args:
        frames_per_step: whose mean is measured.
        references: frames before the press.

    Returns:
        The contacts, how many steps touched nothing, and in how many of those an area was found.
    """
    contacts: list[Light] = []
    empty: list[bool] = []
    for kind in FRUITS:
        for seed, ((x_px, y_px), unit) in enumerate(
            itertools.product(DETECTION_PLACES, DETECTION_UNITS), DETECTION_SEED
        ):
            options = PressOptions(pose=Pose(x_px=x_px, y_px=y_px), unit=unit, references=references)
            closings = [0.0, *light_closings(kind, seed, options)]
            press = squeezed(kind, seed, closings, options, frames_per_step=frames_per_step)
            method = RobustMethod(median_image(press.references), RobustParameters())
            peer = contact_area_idea(median_image(press.references))
            for area_mm2, closing_mm, step in zip((0, *LIGHT_AREAS_MM2), closings, press.steps, strict=True):
                image = mean_image(step.frames)
                contact = method.measure(image)
                if area_mm2 == 0:
                    empty.append(contact.found)
                elif abs(step.true_mm2 / area_mm2 - 1) < 0.3:
                    fruit = seed, options.pose, unit
                    ratio = contact.area_px / step.true_px
                    response = float(method.weak_response(image)[0].max())
                    peer_found = bool(peer(image).any())
                    contacts.append(Light(kind, fruit, area_mm2, closing_mm, ratio, response, peer_found))
    return contacts, len(empty), sum(empty)


def gate_table(contacts: list[Light], presses: list[Beside]) -> list[str]:
    """Return a table of other detection thresholds: lightest contacts found, and detections where nothing touches."""
    lightest = [one.response for one in contacts if one.area_mm2 == LIGHT_AREAS_MM2[0]]
    empty = [one.response for unit in UNITS for one in untouched(unit, "plain")]
    beside: list[float] = []
    for reference, image, far in presses:
        response, _ = RobustMethod(reference, RobustParameters()).weak_response(image)
        size = (response.shape[1], response.shape[0])
        clear = cv2.resize(far.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0
        beside.append(float(response[clear].max()))
    header = f"| a threshold of the response at | finds {LIGHT_AREAS_MM2[0]} mm² | opens on the untouched twin "
    lines = [header + "| beside a real press |", "|---|---|---|---|"]
    for gate in GATES:
        cells = (f"{sum(one > gate for one in some)} of {len(some)}" for some in (lightest, empty, beside))
        lines.append(f"| {gate:g} | " + " | ".join(cells) + " |")
    return [
        *lines,
        "",
        f"The threshold is at {GATE:g}. The untouched twin is that of the plain units above. Beside a real press is",
        f"beyond {UNTOUCHED_RADII:g} radii of its annotated outline, in a single frame against a single reference:",
        "what exceeds it there may be the gel that the ball draws down, which does touch, or a real drift.",
    ]


def more_frames_table(contacts: list[Light]) -> list[str]:
    """Return a table of the contacts found on all four fruits with the recipes' frames, and with more.

    Args:
        contacts: those of the recipes' frames.
    """
    lines = [
        "| frames a step, reference frames | "
        + " | ".join(f"{area:g} mm²" for area in LIGHT_AREAS_MM2)
        + " | area over truth at 1 mm²: p10, median, p90 | areas where nothing touches |",
        "|---" * (len(LIGHT_AREAS_MM2) + 3) + "|",
    ]
    for frames_per_step, references in AVERAGED:
        found, untouched_steps, false = light_contacts(frames_per_step, references)
        cells = [[one for one in found if one.area_mm2 == area] for area in LIGHT_AREAS_MM2]
        counts = " | ".join(f"{sum(one.found for one in cell)} of {len(cell)}" for cell in cells)
        low, middle, high = np.quantile([one.ratio for one in cells[0] if one.found], (0.1, 0.5, 0.9))
        lines.append(
            f"| {frames_per_step}, {references} | {counts} | {low:.2f}, {middle:.2f}, {high:.2f} "
            f"| {false} of {untouched_steps} |"
        )
    peers = [[one.peer_found for one in contacts if one.area_mm2 == area] for area in LIGHT_AREAS_MM2]
    counts = " | ".join(f"{sum(found)} of {len(found)}" for found in peers)
    return [*lines, f"| {PEER}, {AVERAGED[0][0]} and {AVERAGED[0][1]} | {counts} | | |"]


def detection_table(presses: list[Beside]) -> list[str]:
    """The share of light contacts that are found, by their area, and what hides the others.

    Args:
        presses: real ones.
    """
    contacts, _, _ = light_contacts(*AVERAGED[0])
    header = "| found of contacts of | " + " | ".join(f"{area:g} mm²" for area in LIGHT_AREAS_MM2)
    lines = [
        header + " | the slopes' response at 1 mm² | an observer's signal to noise there: median, least "
        "| further closing until first found: median, most |",
        "|---" * (len(LIGHT_AREAS_MM2) + 4) + "|",
    ]
    noise = {unit: noise_of_unit(unit) for unit in DETECTION_UNITS}
    for kind in FRUITS:
        own = [one for one in contacts if one.kind == kind]
        cells = [[one for one in own if one.area_mm2 == area] for area in LIGHT_AREAS_MM2]
        counts = " | ".join(f"{sum(one.found for one in cell)} of {len(cell)}" for cell in cells)
        responses = [one.response for one in cells[0]]
        seen = [signal_to_noise(one, noise[one.fruit[2]]) for one in cells[0]]
        later = closed_further(own)
        lines.append(
            f"| {kind} | {counts} | {min(responses):.1f} to {max(responses):.1f} "
            f"| {np.median(seen):.0f}, {min(seen):.0f} | {np.median(later):.2f}, {max(later):.2f} mm |"
        )
    return [
        *lines,
        "",
        f"A weak contact is searched for where the response is over {GATE:g}. The observer knows the contact's place,",
        "shape and colours beforehand and decides only whether it is there: one known template against the twin's own",
        "noise and drift, beyond columns' and rows' means and slow cosines. The method knows none of these. The last",
        "column is of the fruit that have a contact of 1 mm²: by how much later than there the touch is found.",
        "",
        *more_frames_table(contacts),
        "",
        "Noise is what hides the others: more frames find most of them.",
        "",
        *gate_table(contacts, presses),
    ]


def closed_further(contacts: list[Light]) -> list[float]:
    """By how much each fruit was closed further than at its lightest contact when one of its contacts was found, mm.

    The lightest is the one of 1 mm². A fruit of which none was found counts with its last contact.
    """
    later: list[float] = []
    for lightest in (one for one in contacts if one.area_mm2 == LIGHT_AREAS_MM2[0]):
        own = [one for one in contacts if one.fruit == lightest.fruit]
        found_mm = next((one.closing_mm for one in own if one.found), own[-1].closing_mm)
        later.append(found_mm - lightest.closing_mm)
    return later


def signal_to_noise(contact: Light, noise: list[Floats]) -> float:
    """Of a contact by its own template: its response over that of noise.

    Args:
        contact: on the unit of the noise.
        noise: from `noise_of_unit`.
    """
    seed, pose, unit = contact.fruit
    fruit, gel = draw_fruit(contact.kind, seed), Gel()
    dent = FruitOnGel(fruit, pose, gel).pressed(Squeeze(fruit, gel).at(contact.closing_mm)).dent
    still = DigitSensor(seed, unit, noise=0.0, drift=0.0)
    template = without_slow(still.frame(dent, 0.0).astype(np.float32) - still.frame(None, 0.0))
    if not template.any():
        return 0.0  # The twin's optics show no slope below their first knot.
    responses = [float((one * template).sum()) for one in noise]
    return float((template**2).sum() / np.sqrt(np.mean(np.square(responses))))


def noise_of_unit(unit: int | None) -> list[Floats]:
    """By how much the mean of a step's frames differs from the reference though nothing touches, in several draws."""
    options = PressOptions()
    found: list[Floats] = []
    for draw in range(BOUND_DRAWS):
        sensor = DigitSensor(draw, unit)
        references = [sensor.frame(None, k / FRAMES_PER_S) for k in range(options.references)]
        frames = [sensor.frame(None, options.step_s + k / FRAMES_PER_S) for k in range(FRAMES_PER_STEP)]
        empty = np.mean(frames, axis=0) - np.median(np.stack(references), axis=0)
        found.append(without_slow(empty.astype(np.float32)))
    return found


def without_slow(difference: Floats) -> Floats:
    """A difference at half its size without its columns' and rows' means and its slow cosines."""
    small = cv2.resize(difference, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    small = small - small.mean(axis=0, keepdims=True)
    small = small - small.mean(axis=1, keepdims=True)
    for channel in range(3):
        waves = cv2.dct(np.ascontiguousarray(small[..., channel]))
        waves[: BOUND_COSINES + 1, : BOUND_COSINES + 1] = 0
        small[..., channel] = cv2.idct(waves)
    return small


def light_closings(kind: str, seed: int, options: PressOptions) -> list[float]:
    """The closings at which a fruit's contact is nearest to each of the light areas, by its own truth."""
    closings = np.geomspace(0.002, 1.0, 40)
    fruit = draw_fruit(kind, seed)
    on_gel, squeeze = FruitOnGel(fruit, options.pose, Gel()), Squeeze(fruit, Gel())
    areas = np.array([on_gel.pressed(squeeze.at(float(closing))).true_area_mm2 for closing in closings])
    return [float(closings[np.argmin(np.abs(areas - area))]) for area in LIGHT_AREAS_MM2]

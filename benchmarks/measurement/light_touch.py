"""The lightest touch that the robust method finds on the twin, and what hides lighter ones."""

import itertools
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from measurement.on_the_twin import FRAMES_PER_S, FRAMES_PER_STEP, FRUITS, squeezed
from measurement.peers import contact_area_idea
from station.settings.segmentation import RobustParameters
from station.twin.contact import FruitOnGel, Pose
from station.twin.digit.press import PressOptions
from station.twin.digit.sensor import DigitSensor
from station.twin.fruit import draw_fruit
from station.twin.gel import Gel
from station.twin.squeeze import Squeeze
from station.vision.contact import Image
from station.vision.methods import median_image
from station.vision.robust import RobustMethod
from station.vision.step import mean_image

DETECTION_PLACES = ((240.0, 320.0), (120.0, 160.0), (360.0, 480.0), (120.0, 480.0), (360.0, 160.0))
DETECTION_UNITS = (None, 7)
DETECTION_SEED = 500
LIGHT_AREAS_MM2 = (1, 2, 3, 5)
BOUND_DRAWS = 24
BOUND_COSINES = 6
"""What an observer's template leaves to drift: cosines up to this order, and each column's and row's mean."""

EARLIER = (1.0, 0.8, 0.7, 0.6, 0.5)
"""Shares of the gate's threshold that are tried."""
UNTOUCHED_RADII = 2.5

Beside = tuple[Image, Image, npt.NDArray[np.bool_]]
"""Of a real press its reference, its image, and where in it nothing touches."""


class Light(NamedTuple):
    """One light contact: its fruit, the area meant, whether it was found, and by how much the gate missed it."""

    kind: str
    area_mm2: int
    found: bool
    gate: float
    peer_found: bool
    """Whether PyTouch's contact area has any area."""


def light_contacts() -> tuple[list[Light], list[float]]:
    """Light contacts of each fruit at several places on several units, and the gates where nothing touches."""
    contacts: list[Light] = []
    empty: list[float] = []
    for kind in FRUITS:
        for seed, ((x_px, y_px), unit) in enumerate(itertools.product(DETECTION_PLACES, DETECTION_UNITS), 500):
            options = PressOptions(pose=Pose(x_px=x_px, y_px=y_px), unit=unit)
            closings = [0.0, *light_closings(kind, seed, options)]
            press = squeezed(kind, seed, closings, options)
            method = RobustMethod(press.references, RobustParameters())
            peer = contact_area_idea(median_image(press.references))
            for area_mm2, step in zip((0, *LIGHT_AREAS_MM2), press.steps, strict=True):
                image = mean_image(step.frames)
                contact = method.measure(image)
                if area_mm2 == 0:
                    empty.append(contact.gate or 0.0)
                elif abs(step.true_mm2 / area_mm2 - 1) < 0.3:
                    contacts.append(Light(kind, area_mm2, contact.found, contact.gate or 0.0, bool(peer(image).any())))
    return contacts, empty


def gate_table(contacts: list[Light], empty: list[float], presses: list[Beside]) -> list[str]:
    """What a gate that opens earlier would find on the twin, and where it would open though nothing touches."""
    lightest = [one.gate for one in contacts if one.area_mm2 == LIGHT_AREAS_MM2[0]]
    beside: list[float] = []
    for reference, image, far in presses:
        bend, threshold = RobustMethod([reference], RobustParameters()).bending(image)
        size = (bend.shape[1], bend.shape[0])
        untouched = cv2.resize(far.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0
        beside.append(float(bend[untouched].max()) / threshold)
    lines = [
        f"| a gate at | finds {LIGHT_AREAS_MM2[0]} mm² | opens on the untouched twin | beside a real press |",
        "|---|---|---|---|",
    ]
    for share in EARLIER:
        cells = (f"{sum(gate > share for gate in gates)} of {len(gates)}" for gates in (lightest, empty, beside))
        lines.append(f"| {share:g} of the threshold | " + " | ".join(cells) + " |")
    return [
        *lines,
        "",
        f"Beside a press is beyond {UNTOUCHED_RADII:g} radii of its annotated outline. There the real gel has drifted",
        "against its reference more than the twin's: hence the gate's place.",
    ]


def detection_table(presses: list[Beside]) -> list[str]:
    """The share of light contacts that are found, by their area, and what hides the others.

    Args:
        presses: real ones.
    """
    contacts, empty = light_contacts()
    header = "| found of contacts of | " + " | ".join(f"{area:g} mm²" for area in LIGHT_AREAS_MM2)
    lines = [
        header + " | the gate at 1 mm² | an observer's signal to noise there |",
        "|---" * (len(LIGHT_AREAS_MM2) + 3) + "|",
    ]
    for kind in FRUITS:
        cells = [[one for one in contacts if (one.kind, one.area_mm2) == (kind, area)] for area in LIGHT_AREAS_MM2]
        counts = " | ".join(f"{sum(one.found for one in cell)} of {len(cell)}" for cell in cells)
        gates = np.array([one.gate for one in cells[0]])
        lines.append(
            f"| {kind} | {counts} | {gates.min():.2f} to {gates.max():.2f} | {observer_signal_to_noise(kind):.0f} |"
        )
    peers = [[one.peer_found for one in contacts if one.area_mm2 == area] for area in LIGHT_AREAS_MM2]
    counts = " | ".join(f"{sum(found)} of {len(found)}" for found in peers)
    return [
        *lines,
        f"| PyTouch's contact area, all four | {counts} | | |",
        "",
        f"The gate opens at 1; where nothing touched it reached {max(empty):.2f} in {len(empty)} steps. The observer",
        "knows the contact's place, shape and colours beforehand and asks only whether it is there: one known template",
        "against the twin's own noise and drift, beyond columns' and rows' means and slow cosines. The method knows",
        "none of these.",
        "",
        *gate_table(contacts, empty, presses),
    ]


def observer_signal_to_noise(kind: str) -> float:
    """Of the contact nearest to 1 mm² in the field's middle, by its own template: its response over that of noise."""
    options = PressOptions()
    fruit, gel = draw_fruit(kind, DETECTION_SEED), Gel()
    closing_mm = light_closings(kind, DETECTION_SEED, options)[0]
    dent = FruitOnGel(fruit, options.pose, gel).pressed(Squeeze(fruit, gel).at(closing_mm)).dent
    still = DigitSensor(DETECTION_SEED, noise=0.0, drift=0.0)
    template = without_slow(still.frame(dent, 0.0).astype(np.float32) - still.frame(None, 0.0))
    responses: list[float] = []
    for draw in range(BOUND_DRAWS):
        sensor = DigitSensor(draw)
        references = [sensor.frame(None, k / FRAMES_PER_S) for k in range(options.references)]
        frames = [sensor.frame(None, options.step_s + k / FRAMES_PER_S) for k in range(FRAMES_PER_STEP)]
        empty = np.mean(frames, axis=0) - np.median(np.stack(references), axis=0)
        responses.append(float((without_slow(empty.astype(np.float32)) * template).sum()))
    return float((template**2).sum() / np.sqrt(np.mean(np.square(responses))))


def without_slow(difference: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
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
    closings = np.geomspace(0.002, 0.5, 14)
    fruit = draw_fruit(kind, seed)
    on_gel, squeeze = FruitOnGel(fruit, options.pose, Gel()), Squeeze(fruit, Gel())
    areas = np.array([on_gel.pressed(squeeze.at(float(closing))).true_area_mm2 for closing in closings])
    return [float(closings[np.argmin(np.abs(areas - area))]) for area in LIGHT_AREAS_MM2]

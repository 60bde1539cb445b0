"""Gel check: tear, dirt, LED loss and fog in a picture of the untouched gel.

With an earlier picture of the same gel, only new blemishes count. Without one, only blemishes that no sound gel has:
real units have dust, bubbles and dark corners of their own, so small ones are accepted. Limits were found on real
no-contact images (`docs/verification.md`) and the twin.
"""

from dataclasses import dataclass
from enum import StrEnum

import cv2
import numpy as np
import numpy.typing as npt

from station.messages import calibration as messages
from station.messages.message import Message
from station.vision.contact import Image, Mask
from station.vision.image_quality import DEAD_LED, light, sharpness

_LONG_SIDE_PX = 640
"""Long side of the image for which the numbers in pixels are given: they scale with the image."""
_FINE_PX, _COARSE_PX = 1.5, 12.0
"""The difference of these two blurs shows a tear or debris and not the drift of the light."""
_BLEMISH_LEVELS, _NEW_BLEMISH_LEVELS = 20.0, 12.0
"""Grey levels by which a blemish differs from its surroundings: without an earlier picture, and against one."""
_JOINED_PX = 7
"""Gaps between pixels of one blemish that are bridged. An estimate."""
_SMALLEST_PX, _SMALLEST_NEW_PX = 40, 150
"""Areas below which it is no blemish: without an earlier picture, and against one."""
_BORDER_SHARE = 0.06
"""Share of the width that is not checked along each border: there sensors differ most."""
_MOST_BLEMISHED = 0.006
"""Real units reach 0.0032 of the field."""
_TEAR_LENGTH, _TEAR_SLENDERNESS = 0.5, 10.0
"""A tear's diagonal over the image's width, and over its own mean width; real blemishes reach 0.2 and 6."""
_LED_COLOURS = (messages.BLUE, messages.GREEN, messages.RED)
_MARK = (0, 0, 255)


class GelFault(StrEnum):
    """Faults of gel and light."""

    TEAR = "tear"
    DIRT = "dirt"
    LED = "led"
    FOG = "fog"
    WEAR = "wear"


REMEDIES = {
    GelFault.TEAR: messages.DO_CHANGE_GEL,
    GelFault.DIRT: messages.DO_WIPE,
    GelFault.LED: messages.DO_LED,
    GelFault.FOG: messages.DO_CLEAN,
    GelFault.WEAR: messages.DO_CHANGE_GEL,
}


@dataclass(frozen=True, slots=True, eq=False)
class Finding:
    """One fault with a picture of it."""

    fault: GelFault
    message: Message
    picture: Image


def examine(image: Image, golden: Image | None, least_light: float) -> list[Finding]:
    """Detect tear, dirt, LED loss and fog.

    Args:
        image: the untouched gel, shape (height, width, 3), dtype uint8, BGR.
        golden: the same gel when it was sound, of the same shape; None if there is none.
        least_light: smallest ratio of each colour to the golden picture.
    """
    # Lost light and fog change the whole image: nothing finer can be judged beside them, so each is returned alone.
    lost = _lost_light(image, golden, least_light)
    if lost:
        return lost
    if golden is not None and (fog := sharpness(image) / sharpness(golden)) < least_light:
        fogged = messages.FOGGED(percent=100 * fog)
        return [Finding(GelFault.FOG, fogged, side_by_side(golden, image))]
    return _blemishes(image, golden)


def side_by_side(before: Image, now: Image) -> Image:
    """Join two named pictures of one shape (height, width, 3), dtype uint8, the earlier one left."""
    gap = np.full((before.shape[0], 12, 3), 255, np.uint8)
    return np.hstack([_named(before, "then"), gap, _named(now, "now")])


def _named(image: Image, name: str) -> Image:
    """Write a word into a picture's corner."""
    size = image.shape[1] / 480
    place = (round(14 * size), round(38 * size))
    white, font = (255, 255, 255), cv2.FONT_HERSHEY_SIMPLEX
    return np.asarray(cv2.putText(image.copy(), name, place, font, size, white, 2, cv2.LINE_AA), np.uint8)


def _lost_light(image: Image, golden: Image | None, least_light: float) -> list[Finding]:
    now = light(image)
    # Without an earlier picture the colours are compared with each other: with one LED dead the median is a lit one's.
    # Units differ in their light, so only a dead LED is certain then, and no dimmed one.
    before = (float(np.median(now)),) * 3 if golden is None else light(golden)
    limit = DEAD_LED if golden is None else least_light
    shares = [(level / max(was, 1.0), colour) for level, was, colour in zip(now, before, _LED_COLOURS, strict=True)]
    lost = [(share, colour) for share, colour in shares if share < limit]
    if not lost:
        return []
    colours = [colour(percent=100 * share) for share, colour in lost]
    dead = min(share for share, _ in lost) < DEAD_LED
    of_before = messages.LED_DEAD if dead else messages.LED_DIM
    text = (messages.LED_DEAD_OF_OTHERS if golden is None else of_before)(colours=colours)
    return [Finding(GelFault.LED, text, image if golden is None else side_by_side(golden, image))]


def _blemishes(image: Image, golden: Image | None) -> list[Finding]:
    scale = max(image.shape) / _LONG_SIDE_PX
    found, torn = _regions(image, golden, scale)
    findings: list[Finding] = []
    if torn.any():
        findings.append(Finding(GelFault.TEAR, messages.TORN(), _marked(image, torn)))
    share = float(np.mean(found > 0))
    if share > (_MOST_BLEMISHED if golden is None else 0.0):
        number = cv2.connectedComponents(found)[0] - 1
        blemished = messages.BLEMISHED if golden is None else messages.NEWLY_BLEMISHED
        text = blemished(number=number, percent=100 * share)
        findings.append(Finding(GelFault.DIRT, text, _marked(image, found)))
    return findings


def _regions(image: Image, golden: Image | None, scale: float) -> tuple[Mask, Mask]:
    """Return masks of compact blemishes, and of long thin ones, each 0 or 255."""
    levels = image.astype(np.float32) if golden is None else image.astype(np.float32) - golden
    fine, coarse = (np.asarray(cv2.GaussianBlur(levels, (0, 0), sigma * scale)) for sigma in (_FINE_PX, _COARSE_PX))
    strength = np.abs(fine - coarse).max(axis=2)
    limit, smallest = (_BLEMISH_LEVELS, _SMALLEST_PX) if golden is None else (_NEW_BLEMISH_LEVELS, _SMALLEST_NEW_PX)
    side = max(3, round(_JOINED_PX * scale))
    strong = cv2.morphologyEx((strength > limit).astype(np.uint8), cv2.MORPH_CLOSE, np.ones((side, side), np.uint8))
    margin = round(_BORDER_SHARE * image.shape[1])
    inner = np.zeros_like(strong)
    inner[margin:-margin, margin:-margin] = strong[margin:-margin, margin:-margin]
    _, labels, sizes, _ = cv2.connectedComponentsWithStats(np.asarray(inner, np.uint8))
    compact, thin = np.zeros(strong.shape, np.uint8), np.zeros(strong.shape, np.uint8)
    for label, (_, _, width, height, area) in enumerate(sizes[1:], start=1):
        if area < smallest * scale**2:
            continue
        length = float(np.hypot(width, height))
        # The mean width is area / length, so length² / area is the length over it.
        is_tear = length > _TEAR_LENGTH * image.shape[1] and length**2 / area > _TEAR_SLENDERNESS
        (thin if is_tear else compact)[labels == label] = 255
    return compact, thin


def outlined(image: Image, mask: Mask, colour: tuple[int, int, int] = (255, 255, 255)) -> Image:
    """Draw a mask's outline into a picture of its height and width, in a colour B, G, R."""
    outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return np.asarray(cv2.drawContours(image.copy(), outlines, -1, colour, 2), np.uint8)


def _marked(image: Image, places: npt.NDArray[np.uint8]) -> Image:
    """Draw an outline around places."""
    return outlined(image, np.asarray(cv2.dilate(places, np.ones((9, 9), np.uint8)), np.uint8), _MARK)

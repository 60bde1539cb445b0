"""The robust method's stages as pictures for a person."""

import cv2
import numpy as np

from station.vision.candidates import Candidates
from station.vision.contact import FloatImage, Image, Mask, StageSink
from station.vision.contour import Edge
from station.vision.working import SUBPIXEL_BITS

_GREY = 128.0
_AMPLIFICATION = 4.0
_BLUR_PX = 1.0
_LEVEL_SHOWN = 8.0
"""Grey levels: twice as much is brightest where nothing has moved more."""


def emit(
    on_stage: StageSink,
    names: tuple[str, ...],
    *,
    difference: FloatImage,
    change: FloatImage,
    curvature: FloatImage,
    threshold: float,
    response: FloatImage,
    response_threshold: float,
    candidates: Candidates,
    edges: list[Edge],
    mask: Mask,
) -> None:
    """Hand every stage's picture on, all of the mask's size.

    Args:
        on_stage: takes name and picture.
        names: eight, in the order of the stages.
        difference: frame minus reference, at half the working size, shape (height, width, 3), grey levels.
        change: the same without drift and streaks.
        curvature: shape (height, width), grey levels per pixel.
        threshold: the detection threshold of the curvature.
        response: from `WeakContactDetector.response`, shape of `curvature`.
        response_threshold: from how much of it on a weak contact is outlined.
        candidates: with the level that they stand out in.
        edges: of the contacts found, in pixels of `change`.
        mask: 0 or 255, at the input's size.
    """
    size = (mask.shape[1], mask.shape[0])
    denoised = np.asarray(cv2.GaussianBlur(change, (0, 0), _BLUR_PX), np.float32)
    outlined = cv2.resize(_signed(denoised, _AMPLIFICATION), size, interpolation=cv2.INTER_NEAREST)
    scale = np.divide(size, (change.shape[1], change.shape[0]))
    for edge in edges:
        points = np.rint(((edge.points + 0.5) * scale - 0.5) * (1 << SUBPIXEL_BITS)).astype(np.int32)
        cv2.polylines(
            outlined, [points], isClosed=True, color=(255, 255, 255), lineType=cv2.LINE_AA, shift=SUBPIXEL_BITS
        )
    pictures = (
        _signed(difference, 1),
        _signed(change, _AMPLIFICATION),
        _signed(denoised, _AMPLIFICATION),
        _strength(curvature, threshold),
        _strength(response, response_threshold),
        _strength(candidates.level, _LEVEL_SHOWN),
        outlined,
    )
    for name, picture in zip(names, pictures, strict=False):
        on_stage(name, np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_NEAREST), np.uint8))
    on_stage(names[-1], mask)


def _signed(change: FloatImage, amplification: float) -> Image:
    """No change as middle grey."""
    return np.clip(_GREY + amplification * change, 0, 255).astype(np.uint8)


def _strength(field: FloatImage, threshold: float) -> Image:
    """Colour a field: bright from the threshold on, brightest at twice that, or at the strongest place beyond it."""
    grey = np.clip(field * (255 / max(float(field.max()), 2 * threshold)), 0, 255).astype(np.uint8)
    return np.asarray(cv2.applyColorMap(grey, cv2.COLORMAP_VIRIDIS), np.uint8)

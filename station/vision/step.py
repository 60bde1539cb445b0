"""The contact of one width step, from all of its frames."""

from collections.abc import Mapping, Sequence

import numpy as np

from station.vision.confidence import agreement
from station.vision.contact import Contact, Image, Method


def measure_step(
    method: Method,
    frames: Sequence[Image],
    previous: Contact | None = None,
    known: Mapping[int, Contact] | None = None,
    mean: Image | None = None,
) -> Contact:
    """Measure the mean of a step's frames, and doubt it as far as the frames measured one by one disagree.

    It takes one measurement more than there are frames, or one for a single frame.

    Args:
        method: prepared for the reference.
        frames: one or more of one shape (height, width, 3), dtype uint8, in which nothing has moved.
        previous: the contact of the press's step before; None where the step is measured by itself.
        known: contacts of frames that are measured already, by the frame's `id`.
        mean: the frames' `mean_image` where it is there already.

    Returns:
        The mean image's contact, whose confidence is multiplied by the frames' `agreement`.

    Raises:
        ValueError: there is no frame, or they are not of the reference's shape and of one dtype.
    """
    if not frames:
        raise ValueError("no frame to measure: a step needs at least one")
    known = known or {}
    if len(frames) == 1:
        return known.get(id(frames[0])) or method.measure(frames[0], previous=previous)
    alone = [known.get(id(frame)) or method.measure(frame, previous=previous) for frame in frames]
    agreed = agreement([one.area_px for one in alone])
    return method.measure(mean_image(frames) if mean is None else mean, previous=previous, agreed=agreed)


def mean_image(frames: Sequence[Image]) -> Image:
    """The mean of one or more frames of one shape, dtype uint8, rounded; of one frame itself."""
    if len(frames) == 1:
        return frames[0]
    # Room for 256 frames, the rounding included.
    total = np.zeros(frames[0].shape, np.uint16)
    for frame in frames:
        total += frame
    return ((total + len(frames) // 2) // len(frames)).astype(np.uint8)

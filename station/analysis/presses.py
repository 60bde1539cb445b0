"""Measuring order: the presses among the images, and the order of their steps."""

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import NamedTuple

import numpy as np

from station.analysis.sources import Source

_OPENED_UM = 100
"""By more than this above a press's narrowest width the jaws have opened, µm. Ours: between readings at one place,
which differ by some hundredths of a millimetre, and a count of the gripper, 0.4 mm."""


class Run(NamedTuple):
    """Images that are measured one after the other."""

    numbers: tuple[int, ...]
    """Of the images in the order given by the user, from 0."""
    followed: bool
    """True for the steps of one press: each is measured with the contact of the one before. False for one image."""


def runs(sources: Sequence[Source], widths_mm: Mapping[str, float] | None, *, sequence: bool) -> list[Run]:
    """Find the presses among images.

    A video, a folder, and the files that were named one by one are one press each. Without widths the order given is
    the order in time. With widths it is the order of falling width, unless the images come from a video, the user
    states that they are a sequence, or a width repeats: then the given order is used, and a press ends where the jaws
    have opened.

    Args:
        sources: in the order given by the user.
        widths_mm: the measured width by the image's name, for every image that is not refused; None without a table.
        sequence: the user states that the images are in the order in time.

    Returns:
        Every image once, in the order of measuring.
    """
    found: list[Run] = []
    places = sorted(range(len(sources)), key=lambda number: sources[number].place)
    for _, group in groupby(places, key=lambda number: sources[number].place):
        numbers = list(group)
        images = [number for number in numbers if not sources[number].refused]
        video = any(sources[number].from_video for number in images)
        if widths_mm is not None:
            widths = {number: widths_mm[sources[number].name] for number in images}
            found += _by_width(images, widths, in_time=sequence or video)
        elif sequence or video:
            found.append(Run(tuple(images), followed=True))
        else:
            found += [Run((number,), followed=False) for number in images]
        found += [Run((number,), followed=False) for number in numbers if sources[number].refused]
    return sorted((run for run in found if run.numbers), key=lambda run: min(run.numbers))


def singles(sources: Sequence[Source]) -> list[Run]:
    """Return every image by itself, in the given order."""
    return [Run((number,), followed=False) for number in range(len(sources))]


def _by_width(numbers: Sequence[int], widths_mm: Mapping[int, float], *, in_time: bool) -> list[Run]:
    widths_um = {number: round(1000 * widths_mm[number]) for number in numbers}  # whole ones, to be compared exactly
    if not in_time and not _comes_back([widths_um[number] for number in numbers]):
        return [Run(tuple(sorted(numbers, key=lambda number: -widths_mm[number])), followed=True)]
    presses: list[list[int]] = []
    narrowest_um = 0
    for number in numbers:
        if not presses or widths_um[number] > narrowest_um + _OPENED_UM:
            presses.append([])
            narrowest_um = widths_um[number]
        presses[-1].append(number)
        narrowest_um = min(narrowest_um, widths_um[number])
    return [Run(tuple(press), followed=True) for press in presses]


def _comes_back(widths_um: Sequence[int]) -> bool:
    """Check whether a width repeats after a narrower one: the jaws have opened in between.

    It does not in a press whose images are only named in another order, because the jaws only close.
    """
    widths = np.array(widths_um)
    for place, width in enumerate(widths):
        narrower = np.flatnonzero(widths[:place] < width - _OPENED_UM)
        # By less, not as much: a press may have steps of 0.1 mm.
        if narrower.size and (np.abs(widths[: narrower[-1]] - width) < _OPENED_UM).any():
            return True
    return False

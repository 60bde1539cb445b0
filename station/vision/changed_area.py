"""Changed area: the second, plain measure of a contact, in a few lines that anyone can check.

It is the number of pixels whose change, without the background and after flat-field correction, is longer than a few
times the background's noise. It takes in the halo around a contact and misses a flat centre, so it is no contact area;
but it rises with the contact for every body, and where it and the contour disagree, the contour is not to be
trusted.
"""

import numpy as np

from station.vision.constants import Constants
from station.vision.contact import Mask
from station.vision.region import Movement

_PER_E_FOLD = 4.0
"""How fast the confidence falls with the logarithm by which only the contour has shrunk: to a half at 16 %."""


def changed(moved: Movement, noise_levels: float, constants: Constants) -> Mask:
    """Return the mask of changed pixels: changed by some times the standard deviation where nothing touches.

    Returns:
        Shape (height, width) at half the working size, 0 or 1.
    """
    length = moved.length * moved.flat_field
    return (length > constants.reliable_ratio * noise_levels).astype(np.uint8)


def area_agreement(contact_px: float, changed_px: float, constants: Constants) -> float:
    """Return the agreement of a contact's area and the changed area, in one unit, in size, 0 to 1.

    A contact whose contour takes in only a small part of what has changed is a part of a larger one, or another thing;
    one that hardly holds any change has been drawn around nothing. Between the two says little: a halo changes, and a
    flat centre does not.
    """
    share = max(changed_px, 1.0) / max(contact_px, 1.0)
    return float(min(1.0, constants.witness_most / share, share / constants.witness_least) ** 2)


def growth_agreement(contact_px: tuple[float, float], changed_px: tuple[float, float]) -> float:
    """Return the agreement of contour and changed area, at the last step and now, on a contact's shrinking, 0 to 1."""
    grown, witnessed = (float(np.log(max(now, 1.0) / max(then, 1.0))) for then, now in (contact_px, changed_px))
    return float(np.exp(-_PER_E_FOLD * max(0.0, min(0.0, witnessed) - grown)))

"""Result of a measurement method for one image."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import cv2
import numpy as np
import numpy.typing as npt

from station.vocabulary import Flag

Image = npt.NDArray[np.uint8]
"""A colour image, shape (height, width, 3), dtype uint8, channels B, G, R as OpenCV reads them."""

Mask = npt.NDArray[np.uint8]
"""A mask, shape (height, width), dtype uint8, 0 or 255."""

FloatImage = npt.NDArray[np.float32]
"""Signed grey levels or what is derived from them, shape (height, width) or (height, width, 3), dtype float32."""

StageSink = Callable[[str, npt.NDArray[np.uint8]], None]
"""Takes a stage's name and its picture: (height, width, 3) BGR or (height, width) grey, dtype uint8."""


@dataclass(frozen=True, slots=True)
class Contact:
    """The contact found in one image; `area_px` is 0 and `centroid_px` None where there is none."""

    mask: Mask
    area_px: int
    centroid_px: tuple[float, float] | None
    """x to the right and y down from the centre of the upper left pixel."""
    flags: frozenset[Flag]
    confidence: float | None = None
    """How far the image supports the area, 0 to 1; None where the method does not say."""
    gate: float | None = None
    """The gate's statistic over its threshold: a contact is searched for from 1 on; None where there is no gate."""
    drift_levels: float | None = None
    """Root mean square of the drift against the reference, grey levels; None where it is not measured."""
    is_light: bool = False
    """Found by its slopes only, as a touch lighter than drift: its area is rough."""
    changed_area_px: int | None = None
    """Part of the image that has changed, px: evidence beside the contour; None where the method does not say."""
    trace: object = field(default=None, repr=False, compare=False)
    """What the method takes over from here to the press's next step; for the method alone."""

    @property
    def found(self) -> bool:
        """True if anything touches the gel."""
        return self.area_px > 0

    @property
    def is_firm(self) -> bool:
        """True if a contact was found that is more than weak: closing is counted from such contacts.

        A weak contact may be a place where the gel has changed since the reference.
        """
        return self.found and not self.is_light


class Method(Protocol):
    """A measurement method, made once for a reference and used for many images of its size."""

    stages: tuple[str, ...]
    """The names of the stages' pictures in the order in which they come."""

    def measure(
        self,
        image: Image,
        on_stage: StageSink | None = None,
        previous: "Contact | None" = None,
        agreed: float = 1.0,
        *,
        firm_only: bool = False,
    ) -> Contact:
        """Find the contact in an image.

        Args:
            image: shape and channels as the reference's.
            on_stage: gets each stage's picture; nothing is drawn for it where it is None.
            previous: the same contact at the last step of less compression; a single image is measured without.
            agreed: how far the frames agree of which the image is the mean, 0 to 1; the confidence is multiplied by it.
            firm_only: leave out the search for weak contacts, which takes 2 ms where there is none.

        Raises:
            ValueError: the image's shape or dtype is not the reference's.
        """
        ...


def contact_from_mask(
    mask: Mask,
    flags: frozenset[Flag] = frozenset(),
    *,
    confidence: float | None = None,
    gate: float | None = None,
    drift_levels: float | None = None,
    is_light: bool = False,
    changed_area_px: int | None = None,
    trace: object = None,
) -> Contact:
    """Measure a mask, 0 or 255: its area and centroid, with the flags that follow added; the rest as in `Contact`."""
    area_px, centroid_px = cv2.countNonZero(mask), None
    if area_px:
        # `cv2.moments` of a mask takes ten times as long.
        across, down = (cv2.reduce(mask, axis, cv2.REDUCE_SUM, dtype=cv2.CV_32S).ravel() for axis in (0, 1))
        x_px, y_px = (float(sums @ np.arange(sums.size)) / (255 * area_px) for sums in (across, down))
        centroid_px = x_px, y_px
        if across[0] or across[-1] or down[0] or down[-1]:
            flags |= {Flag.CUT_BY_BORDER}
    elif Flag.UNDECIDED not in flags:
        flags |= {Flag.NO_CONTACT}
    is_light = is_light and area_px > 0
    return Contact(mask, area_px, centroid_px, flags, confidence, gate, drift_levels, is_light, changed_area_px, trace)

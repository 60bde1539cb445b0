"""The published pipeline as printed, unchanged, for comparison.

Source: Computers and Electronics in Agriculture 235 (2025) 110397, image processing of the tactile images:
difference to the untouched gel, amplification, non-local means, K-means, morphology, connected components.
It has no contact gate: K-means always finds its clusters, also where nothing touches.
"""

import cv2
import numpy as np
import numpy.typing as npt

from station.settings.segmentation import PaperParameters
from station.vision.contact import Contact, Image, Mask, StageSink, contact_from_mask
from station.vision.working import PRINTED_IMAGE_PX

_KMEANS_ITERATIONS = 10
_KMEANS_EPSILON = 1.0


class PaperMethod:
    """The paper's pipeline against one reference image."""

    stages: tuple[str, ...] = ("difference", "denoised", "segmented")

    def __init__(self, reference: Image, parameters: PaperParameters) -> None:
        self._reference = reference
        self._parameters = parameters

    def measure(
        self,
        image: Image,
        on_stage: StageSink | None = None,
        previous: Contact | None = None,
        agreed: float = 1.0,
        *,
        firm_only: bool = False,
    ) -> Contact:
        """Find the contact as the paper prints it, in which `previous`, `agreed` and `firm_only` have no part.

        Raises:
            ValueError: the image's shape or dtype is not the reference's.
        """
        parameters = self._parameters
        difference = amplified_difference(image, self._reference, parameters.amplification)
        denoised = denoise(difference, parameters)
        clustered = brightest_cluster(denoised, parameters)
        mask = clean(clustered, parameters)
        if on_stage:
            on_stage("difference", difference)
            on_stage("denoised", denoised)
            on_stage("segmented", mask)
        return contact_from_mask(mask)


def amplified_difference(image: Image, reference: Image, amplification: float) -> Image:
    """Absolute difference of two images of one shape, dtype uint8, times the amplification, clipped to 0..255.

    Raises:
        ValueError: the two differ in shape or are not uint8.
    """
    if image.shape != reference.shape or image.dtype != np.uint8 or reference.dtype != np.uint8:
        raise ValueError(
            f"image {image.shape} {image.dtype} and reference {reference.shape} {reference.dtype} must both be "
            "uint8 and of one shape"
        )
    return np.asarray(cv2.convertScaleAbs(cv2.absdiff(image, reference), alpha=amplification), np.uint8)


def denoise(difference: Image, parameters: PaperParameters) -> Image:
    """Non-local means in colour, shape (height, width, 3), dtype uint8, with the paper's strengths and windows."""
    denoised = cv2.fastNlMeansDenoisingColored(
        difference,
        None,
        parameters.denoise_h,
        parameters.denoise_h_color,
        parameters.template_window_px,
        parameters.search_window_px,
    )
    return np.asarray(denoised, np.uint8)


def brightest_cluster(denoised: Image, parameters: PaperParameters) -> Mask:
    """K-means over the colours, (height, width, 3), uint8; the cluster whose centre is brightest becomes the mask.

    Returns:
        Shape (height, width), dtype uint8, 0 or 255.
    """
    pixels = denoised.reshape(-1, 3).astype(np.float32)
    # OpenCV's generator goes on from call to call: without a seed one image could give different areas.
    cv2.setRNGSeed(parameters.seed)
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, _KMEANS_ITERATIONS, _KMEANS_EPSILON)
    labels: npt.NDArray[np.int32]
    _, labels, centres = cv2.kmeans(  # pyrefly: ignore[no-matching-overload] (OpenCV's stub forbids its own default)
        pixels,
        parameters.clusters,
        None,
        criteria,
        parameters.kmeans_starts,
        cv2.KMEANS_PP_CENTERS,
    )
    brightest = int(np.argmax(centres.sum(axis=1)))
    return np.where(labels.reshape(denoised.shape[:2]) == brightest, 255, 0).astype(np.uint8)


def clean(mask: Mask, parameters: PaperParameters) -> Mask:
    """Closing and opening of a mask, 0 or 255; components below the smallest, in px of a 640x480 image, are dropped."""
    kernel = np.ones((parameters.kernel_px, parameters.kernel_px), np.uint8)
    closed = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, kernel)
    opened = cv2.morphologyEx(closed, cv2.MORPH_OPEN, kernel)
    smallest_px = parameters.smallest_component_px * mask.size / PRINTED_IMAGE_PX
    _, labels, statistics, _ = cv2.connectedComponentsWithStats(opened, connectivity=8)
    keep = statistics[:, cv2.CC_STAT_AREA] >= smallest_px
    keep[0] = False
    return np.where(keep[labels.astype(np.intp)], 255, 0).astype(np.uint8)

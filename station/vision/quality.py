"""Difference of a denoised image from the noisy one: the figures of the paper's Table 2."""

from dataclasses import dataclass

import cv2
import numpy as np

from station.vision.contact import Image


@dataclass(frozen=True, slots=True)
class DenoisingQuality:
    """The paper's three figures; it prints 26.422 dB, 148.197 and 0.550 for its ball."""

    psnr_db: float
    """Peak signal-to-noise ratio over all channels, infinite for equal images."""
    mse: float
    """Mean squared error over all channels, in squared grey levels."""
    ssim: float
    """Structural similarity, mean of the channels, 1 for equal images."""


def denoising_quality(noisy: Image, denoised: Image) -> DenoisingQuality:
    """Compare an image, shape (height, width, 3), dtype uint8, before and after denoising.

    SSIM is Wang et al., IEEE Transactions on Image Processing 13 (2004) 600, with its Gaussian window of 11 pixels
    and sigma 1.5.

    Raises:
        ValueError: the two differ in shape or dtype.
    """
    if noisy.shape != denoised.shape or noisy.dtype != denoised.dtype:
        raise ValueError(f"cannot compare {noisy.shape} {noisy.dtype} with {denoised.shape} {denoised.dtype}")
    mse = float(np.mean(np.square(noisy.astype(np.float32) - denoised)))
    ssim = cv2.quality.QualitySSIM_compute(noisy, denoised)[0]  # pyrefly: ignore[missing-attribute] (missing in OpenCV's stub)
    psnr_db = cv2.PSNR(noisy, denoised) if mse else float("inf")
    return DenoisingQuality(psnr_db=psnr_db, mse=mse, ssim=sum(ssim[:3]) / 3)

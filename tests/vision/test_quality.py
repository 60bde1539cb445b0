"""The denoising's figures against scikit-image's."""

import cv2
import numpy as np
import pytest
from skimage.metrics import mean_squared_error, peak_signal_noise_ratio, structural_similarity

from station.vision.quality import denoising_quality


@pytest.fixture
def noisy() -> np.ndarray:
    return np.random.default_rng(1).integers(0, 255, (120, 90, 3), dtype=np.uint8)


def test_figures_agree_with_another_implementation(noisy):
    denoised = np.asarray(cv2.GaussianBlur(noisy, (3, 3), 0), np.uint8)
    quality = denoising_quality(noisy, denoised)
    assert quality.psnr_db == pytest.approx(peak_signal_noise_ratio(noisy, denoised), rel=1e-5)
    assert quality.mse == pytest.approx(mean_squared_error(noisy, denoised), rel=1e-4)
    peer = structural_similarity(
        noisy, denoised, channel_axis=2, gaussian_weights=True, sigma=1.5, use_sample_covariance=False
    )
    assert quality.ssim == pytest.approx(peer, abs=0.005)


def test_equal_images_are_perfect(noisy):
    quality = denoising_quality(noisy, noisy)
    assert (quality.psnr_db, quality.mse, quality.ssim) == (float("inf"), 0.0, pytest.approx(1.0))


def test_images_of_two_sizes_are_refused(noisy):
    with pytest.raises(ValueError, match="cannot compare"):
        denoising_quality(noisy, noisy[1:])

"""The median of images, beside numpy's."""

import numpy as np
import pytest

from station.vision.median import median_image


@pytest.mark.parametrize("number", range(1, 8))
def test_it_is_numpys_median_rounded_down_and_changes_no_image(number):
    random = np.random.default_rng(number)
    images = [random.integers(0, 256, (12, 10, 3), np.uint8) for _ in range(number)]
    before = [image.copy() for image in images]
    median = median_image(images)
    assert median.dtype == np.uint8
    assert np.array_equal(median, np.median(np.stack(images), axis=0).astype(np.uint8))
    assert all(map(np.array_equal, images, before))

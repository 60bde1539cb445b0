"""Exact one-dimensional clustering."""

import numpy as np
import pytest

from station.vision.clusters import boundaries


@pytest.mark.parametrize("count", [2, 3, 4])
def test_as_many_clusters_as_there_are(count):
    generator = np.random.default_rng(3)
    values = np.concatenate([generator.normal(10 * place, 0.4, 300) for place in range(count)])
    cuts = boundaries(values)
    assert len(cuts) == count - 1
    assert all(abs(cut - (10 * place + 5)) < 4 for place, cut in enumerate(cuts))


def test_equal_values_are_one_cluster():
    assert boundaries(np.full(50, 2.5)) == []

"""The paper's samples, which the twin's fruit are drawn like."""

import csv

import numpy as np
import pytest

from tests.conftest import SHARED

SAMPLES = SHARED / "facts" / "paper-samples.csv"


@pytest.fixture(scope="session")
def paper_samples() -> dict[str, np.ndarray]:
    """Weight, length and width of the paper's fruit, by kind."""
    if not SAMPLES.is_file():
        pytest.skip("the paper's samples are not beside this checkout")
    samples: dict[str, list[list[float]]] = {}
    with SAMPLES.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            samples.setdefault(row["fruit"], []).append(
                [float(row[name]) for name in ("weight_g", "length_mm", "width_mm")]
            )
    return {kind: np.array(rows) for kind, rows in samples.items()}

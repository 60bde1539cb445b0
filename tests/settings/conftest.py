"""Fixtures of the settings' tests: the checkout, a small good recipe, and a file in the test's folder."""

from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

SMALL = """\
schema_version: 1
name: cherry
title: Cherry
plc_number: 7
expected_width:
  smallest_mm: 20
  largest_mm: 30
steps:
  start: onset
  step_mm: 1
  number: 8
  result_closings_mm: [4, 8]
  closing_limit_mm: 8.5
gripper:
  speed_mm_s: 20
  force_n: 20
imaging:
  settle_s: 0.2
  frames_per_step: 3
  reference_frames: 5
damage:
  area:
    - closing_mm: 4
      area_mm2: 100
    - closing_mm: 8
      area_mm2: 150
  growth_mm2_per_mm: 30
early_stop:
  area_mm2: 160
  growth_mm2_per_mm: 40
"""


@pytest.fixture(scope="session")
def root() -> Path:
    """The checkout."""
    return ROOT


@pytest.fixture(scope="session")
def small() -> str:
    """A good recipe, whose line numbers the tests know."""
    return SMALL


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    """Write a file into the test's folder."""

    def write_file(content: str | bytes, name: str = "r.yaml") -> Path:
        path = tmp_path / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return write_file

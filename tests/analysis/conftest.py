"""Tactile images made by code: a coloured gel and a ball pressed into it deeper and deeper."""

from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import pytest

HEIGHT_PX, WIDTH_PX = 320, 240


class Press(NamedTuple):
    """A folder of images with the reference, the widths and the true areas."""

    folder: Path
    reference: Path
    widths: Path
    areas_px: dict[str, int]


def gel(height_px: int = HEIGHT_PX, width_px: int = WIDTH_PX) -> np.ndarray:
    """An untouched gel lit from three sides, (height, width, 3) float."""
    y, x = np.mgrid[0 : 1 : height_px * 1j, 0 : 1 : width_px * 1j]
    return np.stack([90 + 50 * y, 100 + 40 * x, 130 - 50 * x + 10 * y], axis=2)


def pressed(radius_px: float, seed: int, size: tuple[int, int] = (HEIGHT_PX, WIDTH_PX)) -> np.ndarray:
    """The gel with a ball's bowl of this radius in its middle: each colour lights another flank."""
    y, x = np.mgrid[: size[0], : size[1]].astype(float)
    dx, dy = x - size[1] / 2, y - size[0] / 2
    inside = np.hypot(dx, dy) < radius_px
    across, along = dx / max(radius_px, 1), dy / max(radius_px, 1)
    shade = inside[:, :, None] * np.stack([35 + 20 * along, 25 + 20 * across, 25 - 20 * across], axis=2)
    noise = np.random.default_rng(seed).normal(0, 1.5, shade.shape)
    return np.clip(gel(*size) + shade + noise, 0, 255).astype(np.uint8)


@pytest.fixture
def press(tmp_path: Path) -> Press:
    """Six images: one untouched, five deeper and deeper, named so that text order is not number order."""
    folder = tmp_path / "press"
    folder.mkdir()
    reference = tmp_path / "reference.png"
    cv2.imwrite(str(reference), pressed(0, 99))
    rows, areas_px = ["image,width_mm"], {}
    for number, radius_px in zip(range(7, 13), (0, 30, 42, 54, 66, 78), strict=True):
        name = f"frame_{number}.png"
        cv2.imwrite(str(folder / name), pressed(radius_px, number))
        rows.append(f"{name},{46 - number}")
        areas_px[name] = round(np.pi * radius_px**2)
    widths = tmp_path / "widths.csv"
    widths.write_text("\n".join(rows) + "\n")
    return Press(folder, reference, widths, areas_px)

"""Skins of soft bodies: reliefs of a given pitch, made of filtered noise so that no two places are alike."""

from enum import StrEnum

import cv2
import numpy as np

from station.twin.gel import FloatArray

_NARROW, _WIDE = 0.16, 0.27
"""Widths of the two Gaussian filters whose difference passes one pitch, over that pitch."""
_SKEW = 1.2
"""Strength of the curve that makes a pitted skin's pits deeper than its cells are high."""


class Skin(StrEnum):
    """Kinds of surfaces."""

    SMOOTH = "smooth"
    PITTED = "pitted"
    """Rounded cells between pits, as a citrus fruit's peel."""
    ROUGH = "rough"
    """As many bumps as pits: a kiwi's skin, a foam's pores."""


def relief(skin: Skin, pitch_mm: float, grid: tuple[int, int], grid_mm: float, seed: int) -> FloatArray:
    """Heights of a skin: mean 0 and standard deviation 1, positive towards the gel.

    Args:
        skin: the kind of skin.
        pitch_mm: from one pit or bump to the next.
        grid: rows and columns.
        grid_mm: from one of the grid's points to the next.
        seed: the same seed gives the same skin.
    """
    if skin is Skin.SMOOTH:
        return np.zeros(grid, np.float32)
    white = np.random.default_rng([seed, 11]).standard_normal(grid, np.float32)
    narrow, wide = (cv2.GaussianBlur(white, (0, 0), share * pitch_mm / grid_mm) for share in (_NARROW, _WIDE))
    band = (narrow - wide) / np.std(narrow - wide)
    if skin is Skin.PITTED:
        # The hollows of the noise are drawn out to pits; its hills are flattened to rounded cells.
        band = -np.expm1(-_SKEW * band) / _SKEW
        band = np.maximum(band, -4.0)
    return ((band - band.mean()) / band.std()).astype(np.float32)


def waviness(length_mm: float, grid: tuple[int, int], grid_mm: float, seed: int) -> FloatArray:
    """Wide, shallow unevenness of a body: mean 0 and standard deviation 1.

    Args:
        length_mm: the smallest wave's length, about.
        grid: rows and columns.
        grid_mm: from one of the grid's points to the next.
        seed: the same seed gives the same waves.
    """
    cells = [max(4, int(np.ceil(side * grid_mm / length_mm * 2)) + 3) for side in grid]
    coarse = np.random.default_rng([seed, 12]).standard_normal(cells, np.float32)
    field = cv2.resize(coarse, grid[::-1], interpolation=cv2.INTER_CUBIC)
    field = cv2.GaussianBlur(field, (0, 0), length_mm / 5 / grid_mm)
    return ((field - field.mean()) / field.std()).astype(np.float32)

"""Debris on the gel: specks that dent it all the time, and the same specks after some have moved."""

from typing import NamedTuple

import cv2
import numpy as np

from station.twin.gel import GRID_MM, GRID_SHAPE, FloatArray

_SOFTENED_CELLS = 3.0
_MOVED_MM = (1.0, 3.0)
_STAYED, _MOVED, _LOST = 0.4, 0.4, 0.2
"""Shares of the specks that stay, move and fall off when the debris moves; as many come as fall off, on average."""


class Speck(NamedTuple):
    """One particle between the gel and what touches it."""

    x: int
    """Column on the physics' grid."""
    y: int
    """Row on the same grid."""
    radius: int
    """Of the grid's points."""
    depth_mm: float


def scattered(count: int, generator: np.random.Generator) -> list[Speck]:
    """Specks of 0.5 to 1.5 mm anywhere on the gel; four numbers are drawn for each."""
    rows, columns = GRID_SHAPE
    return [
        Speck(
            int(generator.integers(columns)),
            int(generator.integers(rows)),
            int(generator.integers(5, 14)),
            float(generator.uniform(0.1, 0.35)),
        )
        for _ in range(count)
    ]


def moved(specks: list[Speck], generator: np.random.Generator) -> list[Speck]:
    """The specks after something has brushed over the gel: some moved by 1 to 3 mm, some lost, some new.

    At least one speck is no longer where it was.
    """
    now: list[Speck] = []
    for number, speck in enumerate(specks):
        fate = generator.random()
        # Number 0 always moves, so that at least one speck has.
        if fate < _STAYED and number:
            now.append(speck)
        elif fate < _STAYED + _MOVED or not number:
            cells, way = generator.uniform(*_MOVED_MM) / GRID_MM, generator.uniform(0, 2 * np.pi)
            if not 0 <= speck.x + cells * np.cos(way) < GRID_SHAPE[1]:
                way = np.pi - way  # back from the side, so that it stays in sight
            if not 0 <= speck.y + cells * np.sin(way) < GRID_SHAPE[0]:
                way = -way
            x, y = round(speck.x + cells * np.cos(way)), round(speck.y + cells * np.sin(way))
            now.append(speck._replace(x=x, y=y))
    come = generator.binomial(len(specks), _LOST)
    return now + scattered(come, generator)


def dent_of(specks: list[Speck]) -> FloatArray:
    """The dents of the specks, shape (320, 240), mm."""
    dent = np.zeros(GRID_SHAPE, np.float32)
    for speck in specks:
        cv2.circle(dent, (speck.x, speck.y), speck.radius, speck.depth_mm, cv2.FILLED)
    return np.asarray(cv2.GaussianBlur(dent, (0, 0), _SOFTENED_CELLS), np.float32)

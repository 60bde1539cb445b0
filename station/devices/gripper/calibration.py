"""Gripper calibration: conversion of millimetres and newtons to the gripper's counts and settings, and back.

Scales: Robotiq 2F-85 & 2F-140 instruction manual, speed and force registers; linear between the ends, and a force of
20 to 235 N: both unverified on hardware.
"""

from math import ceil, floor

from station.devices.gripper.errors import GripperRequestError
from station.messages import gripper as messages
from station.settings.gripper import GripperCalibration

SLOWEST_MM_S, FASTEST_MM_S = 20.0, 150.0
WEAKEST_N, STRONGEST_N = 20.0, 235.0
_FULL_SCALE = 255
_ROUNDING = 1e-9
"""Tolerance for floating point errors at a tie, or at a whole setting."""


def width_of_count(count: int, calibration: GripperCalibration) -> float:
    """Return the gap for fruit at a position, 0 to 255, mm; negative if the fingers press on each other."""
    opening_mm = (calibration.closed_count - count) * calibration.mm_per_count
    return opening_mm - calibration.finger_offset_mm


def max_width_mm(calibration: GripperCalibration) -> float:
    """Return the gap for fruit when fully open, mm."""
    return width_of_count(calibration.open_count, calibration)


def count_for_width(width_mm: float, calibration: GripperCalibration) -> int:
    """Return the position nearest to a width, mm, at most half a count away; a tie gives the wider gap.

    Raises:
        GripperRequestError: the width is out of reach.
    """
    widest_mm = max_width_mm(calibration)
    if not -_ROUNDING <= width_mm <= widest_mm + _ROUNDING:
        raise GripperRequestError(
            messages.WIDTH_OUT_OF_REACH(width_mm=width_mm, widest_mm=widest_mm), messages.REMEDY_WIDTH()
        )
    exact = calibration.closed_count - (width_mm + calibration.finger_offset_mm) / calibration.mm_per_count
    return ceil(exact - 0.5 - _ROUNDING)


def speed_setting(speed_mm_s: float) -> int:
    """Return the nearest speed setting, 0 to 255.

    Raises:
        GripperRequestError: the gripper cannot move at this speed.
    """
    if not SLOWEST_MM_S <= speed_mm_s <= FASTEST_MM_S:
        raise GripperRequestError(
            messages.SPEED_OUT_OF_RANGE(speed_mm_s=speed_mm_s, slowest_mm_s=SLOWEST_MM_S, fastest_mm_s=FASTEST_MM_S),
            messages.REMEDY_SPEED(),
        )
    return round((speed_mm_s - SLOWEST_MM_S) / (FASTEST_MM_S - SLOWEST_MM_S) * _FULL_SCALE)


def force_setting(force_N: float) -> int:
    """Return the force setting, 0 to 255, rounded down: never more force than requested.

    Raises:
        GripperRequestError: the gripper cannot hold this force.
    """
    if not WEAKEST_N <= force_N <= STRONGEST_N:
        raise GripperRequestError(
            messages.FORCE_OUT_OF_RANGE(force_n=force_N, weakest_n=WEAKEST_N, strongest_n=STRONGEST_N),
            messages.REMEDY_FORCE(),
        )
    return floor((force_N - WEAKEST_N) / (STRONGEST_N - WEAKEST_N) * _FULL_SCALE + _ROUNDING)

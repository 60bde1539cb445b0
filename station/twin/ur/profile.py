"""Trapezoidal speed profile: the way along its path that a motion has made at a time."""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Trapezoid:
    """From rest to rest with a constant acceleration, a constant speed and the like deceleration.

    A way too short to reach the speed gives a triangle.
    """

    distance: float
    speed: float
    acceleration: float

    def __post_init__(self) -> None:
        if self.distance < 0 or self.speed <= 0 or self.acceleration <= 0:
            raise ValueError(f"no motion over {self.distance} at {self.speed} and {self.acceleration}")

    @property
    def peak_speed(self) -> float:
        """The highest speed that is reached."""
        # At most half the way is for speeding up: v² = 2·a·(d/2).
        return min(self.speed, math.sqrt(self.distance * self.acceleration))

    @property
    def duration_s(self) -> float:
        """Time from rest to rest."""
        peak = self.peak_speed
        # The way at full speed, and for each ramp half of its time more.
        return 0.0 if peak == 0 else self.distance / peak + peak / self.acceleration

    def at(self, elapsed_s: float) -> tuple[float, float]:
        """Travel and speed after a time."""
        duration = self.duration_s
        if elapsed_s <= 0:
            return 0.0, 0.0
        if elapsed_s >= duration:
            return self.distance, 0.0
        peak = self.peak_speed
        ramp_s = peak / self.acceleration
        if elapsed_s < ramp_s:
            return 0.5 * self.acceleration * elapsed_s**2, self.acceleration * elapsed_s
        left_s = duration - elapsed_s
        if left_s < ramp_s:
            return self.distance - 0.5 * self.acceleration * left_s**2, self.acceleration * left_s
        return peak * (elapsed_s - 0.5 * ramp_s), peak


@dataclass(frozen=True, slots=True)
class Braking:
    """From a speed to rest with a constant deceleration."""

    start: float
    speed: float
    deceleration: float

    @property
    def duration_s(self) -> float:
        """Time until rest."""
        return self.speed / self.deceleration

    def at(self, elapsed_s: float) -> tuple[float, float]:
        """Travel, counted from the path's beginning, and speed after a time."""
        t = min(max(elapsed_s, 0.0), self.duration_s)
        return self.start + self.speed * t - 0.5 * self.deceleration * t**2, self.speed - self.deceleration * t


Profile = Trapezoid | Braking
"""Travel over time along a path, in the path's own unit (rad of the leading joint, or m of the tool)."""

"""Position and speed of the fingers: counts, millimetres, speed and force settings.

Source: Robotiq 2F-85 data sheet (85 mm, 20 to 150 mm/s) and `count` 3 to 230 as read on real fingers; the force
range of 20 to 235 N and linear scales between the ends are unverified on hardware.
"""

from dataclasses import dataclass

SLOWEST_MM_S, FASTEST_MM_S = 20.0, 150.0
WEAKEST_N, STRONGEST_N = 20.0, 235.0
FULL_SCALE = 255

_IDLE_CURRENT = 10
"""gCU in free motion: the manual's example of a closing gripper reads 0x0A."""
_COUNTS_PER_N = 0.4
"""gCU added by each newton while moving; unverified on hardware."""


@dataclass(frozen=True, slots=True)
class Fingers:
    """The travel of one set of fingers."""

    open_count: int = 3
    closed_count: int = 230
    stroke_mm: float = 85.0

    def opening_mm(self, count: int) -> float:
        """The opening of a position request; requests beyond the ends mean the ends."""
        within = min(max(count, self.open_count), self.closed_count)
        return self.stroke_mm * (self.closed_count - within) / (self.closed_count - self.open_count)

    def count(self, opening_mm: float) -> int:
        """The position that the encoder reads at an opening."""
        travel = self.closed_count - self.open_count
        return round(self.closed_count - opening_mm / self.stroke_mm * travel)


def speed_mm_s(setting: int) -> float:
    """The speed of a speed setting (0 to 255)."""
    return SLOWEST_MM_S + (FASTEST_MM_S - SLOWEST_MM_S) * setting / FULL_SCALE


def grip_force_n(setting: int) -> float:
    """The grip force of a force setting (0 to 255); 0 is not zero force."""
    return WEAKEST_N + (STRONGEST_N - WEAKEST_N) * setting / FULL_SCALE


def moving_current(reaction_n: float) -> int:
    """The motor current while moving against a reaction force, in 10 mA, 0 to 255."""
    return min(FULL_SCALE, _IDLE_CURRENT + round(_COUNTS_PER_N * abs(reaction_n)))

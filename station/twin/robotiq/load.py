"""Load between the fingers, as far as the gripper can feel it."""

from dataclasses import dataclass
from typing import Protocol


class Load(Protocol):
    """Something that pushes back on the fingers."""

    def force_N(self, opening_mm: float) -> float:  # noqa: N802 (the unit's symbol is a capital)
        """Reaction force on one finger at an opening of the pads, 0 (closed) to 85 mm; 0 where nothing is touched.

        Returns:
            Newton; positive pushes the fingers apart and resists closing, negative resists opening.
        """
        ...


class NoLoad:
    """Nothing between the fingers."""

    def force_N(self, opening_mm: float) -> float:  # noqa: N802 (the unit's symbol is a capital)
        """Always 0."""
        return 0.0


@dataclass(slots=True)
class Spring:
    """A linear spring between the fingers."""

    free_mm: float
    """The opening at which it is just touched."""
    stiffness_n_per_mm: float

    def force_N(self, opening_mm: float) -> float:  # noqa: N802 (the unit's symbol is a capital)
        """Stiffness times compression, 0 while untouched."""
        return self.stiffness_n_per_mm * max(0.0, self.free_mm - opening_mm)

"""Simulated calibration rig: a ball between the twin's gel and sponge, without gripper and wire, for many repeats."""

from typing import NamedTuple

import numpy as np

from station.calibration.rig import Place
from station.inspection.press import FINEST_STEP_MM
from station.messages.message import Message
from station.press.rig import Position
from station.settings.calibration import CalibrationSettings
from station.settings.gripper import GripperCalibration
from station.twin.contact import MIDDLE_X_PX, MIDDLE_Y_PX, FruitOnGel, Pose
from station.twin.digit.codec import Image
from station.twin.digit.sensor import Condition, DigitSensor
from station.twin.fruit import Kind, draw_fruit
from station.twin.gel import MM_PER_PX, Gel
from station.twin.squeeze import Squeeze

_HOLDER_MM = CalibrationSettings().holder_mm
_FRAME_S, _STEP_S = 1 / 30, 1.3
"""Time of a frame at 30 a second, and of one width step. An estimate."""
_GRIPPER = GripperCalibration()


class SimulatedFrame(NamedTuple):
    """One frame of the twin's sensor."""

    image: Image
    captured_s: float
    sequence: int = 0


class StationaryRig:
    """The verbs that do nothing on a rig without an arm, whose moves take their time at once."""

    async def make_ready(self) -> None:
        """Do nothing: it always is."""

    async def leave_nest(self) -> None:
        """Do nothing: there is no arm."""

    async def enter_nest(self) -> None:
        """Do nothing: there is no arm."""

    async def settle(self) -> None:
        """Do nothing: the time has passed."""


class SimulatedRig(StationaryRig):
    """A rig whose widths are whole counts of the gripper, and whose light drifts from step to step.

    Args:
        seed: of the sensor's noise and drift.
        unit: of the sensor's light.
        mm_per_px: the sensor's true scale.
        kind: the object in the nest.
        condition: fault of the sensor.
        holder_mm: thickness of the ball's holder; it shifts the contact onset.
        spill_mm: standard deviation of the ball's place.
        frames_per_step: at most so many frames of a step, for runs with many repeats.
    """

    widest_mm = 53.0
    finest_step_mm = FINEST_STEP_MM

    def __init__(
        self,
        seed: int = 1,
        *,
        unit: int | None = None,
        mm_per_px: float = MM_PER_PX,
        kind: Kind = Kind.RUBBER_BALL,
        condition: Condition | None = None,
        holder_mm: float = _HOLDER_MM,
        spill_mm: float = 0.0,
        frames_per_step: int = 1,
    ) -> None:
        self._gel = Gel(mm_per_px=mm_per_px)
        self._fruit, self._holder_mm = draw_fruit(kind, seed), holder_mm
        self._sensor = DigitSensor(seed, unit, mm_per_px=mm_per_px)
        self.condition = condition or Condition()
        self._spill, self._spill_mm = np.random.default_rng([seed, 9]), spill_mm
        self._frames_per_step = frames_per_step
        self._now_s, self._width_mm = 0.0, self.widest_mm
        self.released = 0
        self.places: list[Place] = []
        self._contact = FruitOnGel(self._fruit, Pose(), self._gel)

    async def open(self, width_mm: float | None = None) -> Position:
        """Open the jaws; an object too wide for the open jaws still touches."""
        self._width_mm = self.widest_mm if width_mm is None else width_mm
        self._now_s += _STEP_S
        return Position(self._width_mm)

    async def close_to(self, width_mm: float) -> Position:
        """Move to the nearest count of the gripper; the time of a whole step passes."""
        closed, count_mm, fingers_mm = _GRIPPER.closed_count, _GRIPPER.mm_per_count, _GRIPPER.finger_offset_mm
        count = round(closed - (width_mm + fingers_mm) / count_mm)
        self._width_mm = (closed - count) * count_mm - fingers_mm
        self._now_s += _STEP_S
        return Position(self._width_mm)

    async def frames(self, number: int) -> tuple[SimulatedFrame, ...]:
        """Return frames, of a step at most so many as this rig was made for."""
        is_open = self._width_mm >= self.widest_mm
        squeezed = Squeeze(self._fruit, self._gel, held_s=_STEP_S).at(self.closing_mm)
        dent = self._contact.pressed(squeezed).dent if squeezed.closing_mm > 0 else None
        frames: list[SimulatedFrame] = []
        for _ in range(number if is_open else min(number, self._frames_per_step)):
            frames.append(SimulatedFrame(self._sensor.frame(dent, self._now_s, self.condition), self._now_s))
            self._now_s += _FRAME_S
        return tuple(frames)

    async def lay(self, place: Place) -> None:
        """Lay the ball at a place, with the place's deviation."""
        self.places.append(place)
        x_mm, y_mm = (mm + self._spill_mm * self._spill.standard_normal() for mm in place)
        scale = self._gel.mm_per_px
        self._contact = FruitOnGel(self._fruit, Pose(MIDDLE_X_PX + x_mm / scale, MIDDLE_Y_PX + y_mm / scale), self._gel)

    async def release(self, failed: Message | None = None) -> None:
        """Open the jaws."""
        self.released += 1
        self._width_mm = self.widest_mm

    @property
    def closing_mm(self) -> float:
        """Return the closing since the contact onset."""
        return self._fruit.width_mm + self._holder_mm - self._width_mm

    def true_area_px(self, width_mm: float) -> int:
        """Return the area inside the visible edge at a width."""
        closing_mm = self._fruit.width_mm + self._holder_mm - width_mm
        return self._contact.pressed(Squeeze(self._fruit, self._gel).at(closing_mm)).true_area_px

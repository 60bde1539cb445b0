"""The gripper behind its registers: activation, travel in real time, contact, drop and faults.

Behaviour: Robotiq 2F-85 & 2F-140 instruction manual, chapter 4. Unverified on hardware: the order and force of the
activation's travel, the speed of the automatic release, and what an emergency stop leaves behind.
"""

from dataclasses import dataclass, replace
from enum import IntEnum

from station.twin.clock import Clock
from station.twin.faults import CommonFault, FaultBoard
from station.twin.robotiq.faults import MAJOR, MINOR, Code, GripperFault
from station.twin.robotiq.fingers import (
    FASTEST_MM_S,
    SLOWEST_MM_S,
    Fingers,
    grip_force_n,
    moving_current,
    speed_mm_s,
)
from station.twin.robotiq.load import Load, NoLoad
from station.twin.robotiq.registers import COMMAND_ADDRESS, REGISTERS, STATUS_ADDRESS, Command, Status

_SLOWEST = 1000.0
_PROBE_MM = 0.1
"""The load is computed at least this often along the travel."""
_CONTACT_MM = 0.001
"""How closely the place of first contact is found."""
_ACTIVATION_FORCE_N = 40.0


class _State(IntEnum):
    RESET = 0
    ACTIVATING = 1
    ACTIVE = 3


class _Object(IntEnum):
    MOVING = 0
    CONTACT_OPENING = 1
    CONTACT_CLOSING = 2
    AT_POSITION = 3


@dataclass(frozen=True, slots=True)
class _Leg:
    """One stretch of travel."""

    target_mm: float
    speed_mm_s: float
    force_n: float


class RobotiqGripper:
    """A 2F-85, advanced to the clock's time whenever it is read."""

    def __init__(
        self, clock: Clock, faults: FaultBoard, load: Load | None = None, fingers: Fingers | None = None
    ) -> None:
        self.clock = clock
        self.faults = faults
        self.load: Load = load or NoLoad()
        self._fingers = fingers or Fingers()
        self._now_s = clock.now_s()
        self._opening_mm = self._fingers.stroke_mm
        self._command = Command()
        self._state = _State.RESET
        self._object = _Object.MOVING
        self._latched = Code.NONE
        self._legs: list[_Leg] = []
        self._in_motion = False
        self._calibrated = True

    def opening_mm(self, now_s: float) -> float:
        """The distance between the gripper's own pads; a time already passed gives the latest opening."""
        self._advance(now_s)
        return self._opening_mm

    @property
    def command(self) -> Command:
        """The command in force."""
        return self._command

    def status(self) -> Status:
        """The status registers as they read now."""
        self._advance(self.clock.now_s())
        offset = round(min(255.0, max(-255.0, self.faults.amount(CommonFault.WRONG))))
        return Status(
            activate=self._command.activate,
            go_to=self._command.go_to,
            state=self._state,
            object_=self._object,
            fault=self._fault(),
            echo=(self._command.position + offset) % 256,
            position=(self._fingers.count(self._opening_mm) + offset) % 256 if self._calibrated else 0,
            current=moving_current(self._reaction_n(self._opening_mm)) if self._in_motion else 0,
        )

    def write(self, command: Command) -> None:
        """Take a command; gOBJ is cleared before this returns where it requests another motion."""
        now_s = self.clock.now_s()
        # The time up to now belongs to the command before.
        self._advance(now_s)
        before = self._command
        if self.faults.active(CommonFault.STUCK) or command == before:
            return
        self._command = command
        if not command.activate:
            self._state, self._legs = _State.RESET, []
        elif not before.activate:
            self._begin_activation()
        if command.release and not before.release:
            self._latch(Code.RELEASING)
        self._object = _Object.MOVING
        self._in_motion = False

    def read_register(self, address: int) -> int:
        """One register.

        Raises:
            KeyError: there is none at this address.
        """
        for start, words in ((STATUS_ADDRESS, self.status().words()), (COMMAND_ADDRESS, self._command.words())):
            if start <= address < start + REGISTERS:
                return ([*words, *[0] * (REGISTERS - len(words))])[address - start]
        raise KeyError(address)

    def write_registers(self, address: int, values: list[int]) -> None:
        """Write registers in one go; reserved ones are accepted and ignored.

        Raises:
            KeyError: not all of them are command registers.
        """
        first = address - COMMAND_ADDRESS
        if first < 0 or first + len(values) > REGISTERS:
            raise KeyError(address)
        # Registers that this write leaves out retain their values.
        words = [*self._command.words(), *[0] * REGISTERS][:REGISTERS]
        words[first : first + len(values)] = values
        self.write(Command.from_words(words))

    def _begin_activation(self) -> None:
        self._latched = Code.NONE
        self._state = _State.ACTIVATING
        self._legs = [
            _Leg(0.0, FASTEST_MM_S, _ACTIVATION_FORCE_N),
            _Leg(self._fingers.stroke_mm, FASTEST_MM_S, _ACTIVATION_FORCE_N),
        ]

    def _latch(self, code: Code) -> None:
        self._latched = code
        self._state = _State.RESET
        self._legs = []
        if code == Code.RELEASING:
            end_mm = self._fingers.stroke_mm if self._command.release_opens else 0.0
            self._legs = [_Leg(end_mm, SLOWEST_MM_S, _ACTIVATION_FORCE_N)]

    def _fault(self) -> Code:
        if self._latched:
            return self._latched
        for fault, code in MINOR.items():
            if self.faults.active(fault):
                return code
        if self._command.go_to and not self._command.activate:
            return Code.ACTIVATION_BIT
        if self._command.go_to and self._state != _State.ACTIVE:
            return Code.ACTIVATE_FIRST
        return Code.NONE

    def _advance(self, now_s: float) -> None:
        """Bring the state up to a time, under the faults that are on now."""
        remaining_s = now_s - self._now_s
        if remaining_s <= 0:
            return
        # Time passes for stuck fingers too: they do not catch up once the fault is off.
        self._now_s = now_s
        if self.faults.active(CommonFault.STUCK):
            return
        self._in_motion = False
        self._take_faults()
        if self.faults.active(GripperFault.OVER_TEMPERATURE):
            return
        while self._legs and remaining_s > 0:
            remaining_s = self._travel(self._legs[0], remaining_s)
            if remaining_s > 0:
                self._legs.pop(0)
                self._finish_legs()
        if remaining_s > 0 and self._state == _State.ACTIVE and self._command.go_to:
            self._go_to(remaining_s)

    def _take_faults(self) -> None:
        if GripperFault.POWER_CUT in self.faults.take_new():
            self._command, self._state, self._latched = Command(), _State.RESET, Code.NONE
            self._legs, self._calibrated = [], False
        for fault, code in MAJOR.items():
            if not self._latched and self.faults.active(fault):
                self._latch(code)
        if self.faults.active(GripperFault.EMERGENCY_STOPPED):
            self._command = replace(self._command, go_to=False)
            self._legs = []
            if self._state == _State.ACTIVATING:
                self._state = _State.RESET

    def _finish_legs(self) -> None:
        if self._legs:
            return
        if self._latched == Code.RELEASING:
            self._latched = Code.RELEASED
        elif self.faults.active(GripperFault.ACTIVATION_FAULT):
            self._latch(Code.ACTIVATION)
        else:
            self._state, self._calibrated = _State.ACTIVE, True

    def _go_to(self, duration_s: float) -> None:
        command = self._command
        leg = _Leg(self._fingers.opening_mm(command.position), speed_mm_s(command.speed), grip_force_n(command.force))
        # What was held is gone: the gripper then reports 3, while its fingers go on.
        if self._object != _Object.MOVING and self._resistance_n(leg, self._opening_mm) <= 0:
            self._object = _Object.AT_POSITION
        closing = leg.target_mm < self._opening_mm
        arrived = self._travel(leg, duration_s) > 0
        # Exact, since a leg without contact ends at the target itself.
        if arrived and self._opening_mm == leg.target_mm:
            self._object = _Object.AT_POSITION
        elif arrived:
            self._object = _Object.CONTACT_CLOSING if closing else _Object.CONTACT_OPENING

    def _travel(self, leg: _Leg, duration_s: float) -> float:
        """Move along a leg and return the time left, 0 where it is still under way; contact ends a leg."""
        speed_mm_s = leg.speed_mm_s / (1.0 + min(_SLOWEST, max(0.0, self.faults.amount(CommonFault.SLOW))))
        start_mm = self._opening_mm
        distance_mm = abs(leg.target_mm - start_mm)
        reach_mm = speed_mm_s * duration_s
        goal_mm = leg.target_mm
        if reach_mm < distance_mm:
            goal_mm = start_mm + (reach_mm if leg.target_mm > start_mm else -reach_mm)
        stopped_mm = self._first_contact(leg, goal_mm)
        self._opening_mm = goal_mm if stopped_mm is None else stopped_mm
        if stopped_mm is None and reach_mm <= distance_mm:
            self._in_motion = reach_mm < distance_mm
            return 0.0
        return duration_s - abs(self._opening_mm - start_mm) / speed_mm_s

    def _first_contact(self, leg: _Leg, goal_mm: float) -> float | None:
        """The first opening on the way to a goal where the load holds the leg's force; None where it never does."""
        free_mm = self._opening_mm
        if free_mm == goal_mm:
            return None
        if self._holds(leg, free_mm):
            return free_mm
        # The load may be any function of the opening: sampled for the first contact, which bisection then refines.
        steps = int(abs(goal_mm - free_mm) / _PROBE_MM) + 1
        start_mm = free_mm
        for step in range(1, steps + 1):
            # Counted back from the goal, so that the last step is the goal to the bit.
            held_mm = goal_mm + (start_mm - goal_mm) * (steps - step) / steps
            if self._holds(leg, held_mm):
                while abs(held_mm - free_mm) > _CONTACT_MM:
                    middle_mm = (held_mm + free_mm) / 2
                    if self._holds(leg, middle_mm):
                        held_mm = middle_mm
                    else:
                        free_mm = middle_mm
                return held_mm
            free_mm = held_mm
        return None

    def _holds(self, leg: _Leg, opening_mm: float) -> bool:
        return self._resistance_n(leg, opening_mm) >= leg.force_n

    def _resistance_n(self, leg: _Leg, opening_mm: float) -> float:
        closing = leg.target_mm < self._opening_mm
        return self._reaction_n(opening_mm) * (1.0 if closing else -1.0)

    def _reaction_n(self, opening_mm: float) -> float:
        if self.faults.active(GripperFault.OBJECT_DROPPED):
            return 0.0
        return self.load.force_N(opening_mm)

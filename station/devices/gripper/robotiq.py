"""Driver of the Robotiq 2F-85, the same over both wires. Unverified on hardware."""

import asyncio
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress

from station.devices.gripper.calibration import (
    WEAKEST_N,
    count_for_width,
    force_setting,
    max_width_mm,
    speed_setting,
    width_of_count,
)
from station.devices.gripper.errors import (
    NEEDS_ACTIVATION,
    GripperError,
    GripperFaultError,
    GripperNotActiveError,
    GripperStoppedError,
    GripperTimeoutError,
)
from station.devices.gripper.interface import GripperReading, MoveResult, ObjectState
from station.devices.gripper.link import Link, State, Status
from station.devices.gripper.modbus_rtu import ModbusRtuLink
from station.devices.gripper.urcap import UrcapLink, emergency_stopped
from station.messages import gripper as messages
from station.messages.message import Message
from station.settings.gripper import GripperSettings

_POLL_S = 0.005
"""The gripper refreshes its registers at 200 Hz (manual, Modbus RTU communication)."""
_RESET_HOLD_S = 0.5
"""Between reset and activation, as in the drivers that are known to work; also the longest life of an old fault."""
_SILENCE_S = 1.0
"""Silence of the line after which the gripper reports fault 9 (manual)."""
_MUTE_GRACE_S = 0.5
"""The next request clears fault 9: only a lasting one is real."""
_AT_POSITION_COUNTS = 2
"""Largest distance from the request that counts as at position."""
STRIDE_MM, STRIDE_S = 3.0, 0.15
"""How far ahead closing fingers are sent, whichever is longer: those of a killed process stop there. As far as they go
unseen at most while they search the contact; at 20 mm/s both are the same."""
_HALT_ANSWERS = 4
"""Time for a quiet line, a connection and the two exchanges of a halt, in answer time-outs."""
_NO_COMMUNICATION = 0x9

_OBJECT_STATES = {
    0: ObjectState.MOVING,
    1: ObjectState.CONTACT_OPENING,
    2: ObjectState.CONTACT_CLOSING,
    3: ObjectState.AT_POSITION,
}
_STATE_MESSAGES = {
    ObjectState.IDLE: messages.STATE_IDLE(),
    ObjectState.MOVING: messages.STATE_MOVING(),
    ObjectState.CONTACT_OPENING: messages.STATE_CONTACT_OPENING(),
    ObjectState.CONTACT_CLOSING: messages.STATE_CONTACT_CLOSING(),
    ObjectState.AT_POSITION: messages.STATE_AT_POSITION(),
}


class Robotiq2F85:
    """A 2F-85 behind a wire. Methods that move run one at a time; `read` and `stop` may be called at any time.

    After a lost link the error comes after one short attempt to stop, and the next call connects again. Nothing is ever
    repeated automatically: use `read` for the fingers' position.
    """

    def __init__(self, link: Link, settings: GripperSettings) -> None:
        self.link = link
        self._settings = settings
        self._calibration = settings.calibration
        self._turn = asyncio.Lock()
        self._stops = 0
        self._held_request: int | None = None
        self._mute_since_s: float | None = None
        self._polled_s = 0.0
        self.known_width_mm: float | None = None
        """Gap at which the fingers were last read at rest while active; None once they were sent elsewhere."""

    @property
    def max_width_mm(self) -> float:
        """Return the widest gap for fruit."""
        return max_width_mm(self._calibration)

    async def activate(self) -> GripperReading:
        """Make the gripper ready. Idempotent: one that is active does not move, even if it reports a passing fault.

        Otherwise **the fingers travel their whole way**, also when the wait for them is cancelled, and `stop` ends it
        only before they do: nothing may be between them.

        Raises:
            GripperFaultError: a fault that a reset and an activation do not clear.
            GripperStoppedError: `stop` was called before the fingers travelled; the gripper is not active.
            GripperTimeoutError: it answers, but does not become active.
            GripperError: the wire.
        """
        stops = self._stops
        async with self._turn:
            status, at_s = await self._poll()
            if self._is_active(status):
                return self._reading(status, at_s)
            self._held_request = self.known_width_mm = None
            deadline_s = time.monotonic() + self._settings.activation_timeout_s
            await self.link.reset()
            while (await self._poll())[0].state != State.RESET:
                await self._wait_until(deadline_s, time.monotonic(), messages.STEP_RESET(), None)
                await self.link.reset()
            await asyncio.sleep(_RESET_HOLD_S)
            self._go_on_unless_stopped(stops)  # until here nothing has moved
            await self.link.begin_activation()
            began_s = time.monotonic()
            while True:
                status, at_s = await self._poll()
                if self._is_active(status):
                    return self._reading(status, at_s)
                if status.fault and time.monotonic() - began_s > _RESET_HOLD_S:
                    raise GripperFaultError(status.fault)
                await self._wait_until(deadline_s, at_s, messages.STEP_ACTIVATION(), status)

    async def open(self, width_mm: float | None = None) -> MoveResult:
        """Open fast: fully, or to a width. Idempotent. Raises as `move_to_width`."""
        to_mm = self.max_width_mm if width_mm is None else width_mm
        return await self.move_to_width(to_mm, self._settings.opening_speed_mm_s, WEAKEST_N)

    async def move_to_width(self, width_mm: float, speed_mm_s: float, force_N: float) -> MoveResult:
        """Move until the width is reached or an object is detected. Idempotent.

        A move that fails or is cancelled stops the fingers if the wire still allows it. Closing fingers are sent on in
        strides before they reach the last one's end, so that they do not stop.

        Args:
            width_mm: gap between the finger surfaces, 0 to `max_width_mm`; the nearest count is requested.
            speed_mm_s: 20 to 150.
            force_N: 20 to 235, where to stop on contact.

        Raises:
            GripperRequestError: out of reach; nothing was sent.
            GripperNotActiveError: not activated; nothing was sent.
            GripperFaultError: the gripper reports a fault.
            GripperStoppedError: `stop` was called meanwhile.
            GripperTimeoutError: it answers, but does not get there.
            GripperError: the wire.
        """
        count = count_for_width(width_mm, self._calibration)
        speed, force = speed_setting(speed_mm_s), force_setting(force_N)
        stops = self._stops
        async with self._turn:
            before, _ = await self._ready()
            self._go_on_unless_stopped(stops)
            travel_s = abs(before.position - count) * self._calibration.mm_per_count / speed_mm_s
            deadline_s = time.monotonic() + travel_s + self._settings.move_margin_s
            stride = int(max(STRIDE_MM, STRIDE_S * speed_mm_s) / self._calibration.mm_per_count)
            self._held_request = None
            try:
                sent = min(count, before.position + stride)
                while True:
                    try:
                        await self.link.go_to(sent, speed, force)
                    finally:
                        # Also after a failure: the command may have reached the gripper.
                        self.known_width_mm = None
                    renewed_at = stride // 2 if sent < count else None
                    status, at_s = await self._arrival(sent, deadline_s, stops, renewed_at)
                    if sent == count or _OBJECT_STATES[status.object_] == ObjectState.CONTACT_CLOSING:
                        break
                    sent = min(count, max(sent, status.position + stride))
            except (GripperError, asyncio.CancelledError):
                await self._halt_if_possible()
                raise
            reading = self._reading(status, at_s)
            if reading.object_state == ObjectState.CONTACT_CLOSING:
                self._held_request = sent
            return MoveResult(width_mm, reading)

    async def stop(self) -> GripperReading:
        """Stop where the fingers are; moves under way or waiting end with `GripperStoppedError`. Idempotent.

        Raises:
            GripperError: the wire.
        """
        self._stops += 1
        self._held_request = None
        await self.link.halt()
        return await self.read()

    async def read(self) -> GripperReading:
        """Read the gripper, without moving it; a fault is part of the reading, not raised.

        Raises:
            GripperError: the wire.
        """
        return self._reading(*await self._poll())

    async def close(self) -> None:
        """Close the wire, not the fingers. Idempotent; a later call opens the wire again."""
        await self.link.close()

    async def _poll(self) -> tuple[Status, float]:
        at_s = time.monotonic()
        status = await self.link.status()
        if status.fault != _NO_COMMUNICATION or at_s - self._polled_s >= _SILENCE_S:
            self._mute_since_s = None  # a report of fault 9 after a silence is of that silence
        self._polled_s = at_s
        if status.state == State.ACTIVE:
            at_rest = not status.go_to or _OBJECT_STATES[status.object_] != ObjectState.MOVING
            self.known_width_mm = width_of_count(status.position, self._calibration) if at_rest else None
        return status, at_s

    async def _ready(self) -> tuple[Status, float]:
        """Return the status of a gripper that may move."""
        status, at_s = await self._poll()
        fault = self._active_fault(status, at_s)
        if fault:
            raise GripperFaultError(fault)
        if status.state != State.ACTIVE:
            raise GripperNotActiveError(messages.NOT_ACTIVE(), messages.REMEDY_CLEAR_AND_ACTIVATE())
        return status, at_s

    async def _arrival(self, count: int, deadline_s: float, stops: int, renewed_at: int | None) -> tuple[Status, float]:
        """Return the status once the fingers rest at the place itself, or by two consecutive readings at the same one.

        Args:
            renewed_at: so many counts before the place it is also returned while they move; None for a last place.
        """
        position = None
        while True:
            status, at_s = await self._ready()
            self._go_on_unless_stopped(stops)
            at_rest = self._at_rest(status, count)
            if status.echo == count and at_rest and status.position in {position, count}:
                return status, at_s
            if not at_rest and renewed_at is not None and count - status.position <= renewed_at:
                return status, at_s
            position = status.position
            await self._wait_until(deadline_s, at_s, messages.STEP_MOVE(count=count), status)

    def _go_on_unless_stopped(self, stops: int) -> None:
        if self._stops != stops:
            raise GripperStoppedError(messages.STOPPED(), messages.REMEDY_STOPPED())

    async def _halt_if_possible(self) -> None:
        """Try once to stop, which delays the error by a few answers at most."""
        with suppress(GripperError, TimeoutError):
            async with asyncio.timeout(_HALT_ANSWERS * self._settings.answer_timeout_s):
                await self.link.halt()

    @staticmethod
    def _is_active(status: Status) -> bool:
        return status.state == State.ACTIVE and status.fault not in NEEDS_ACTIVATION

    @staticmethod
    def _at_rest(status: Status, count: int) -> bool:
        state = _OBJECT_STATES[status.object_]
        if state == ObjectState.AT_POSITION:
            return abs(status.position - count) <= _AT_POSITION_COUNTS
        return state != ObjectState.MOVING

    @staticmethod
    async def _wait_until(deadline_s: float, asked_s: float, step: Message, status: Status | None) -> None:
        # By when the gripper was asked: fingers that arrived in time are not late because the answer was read late.
        if asked_s > deadline_s:
            late = _late_at(step, status) if status else messages.LATE(step=step)
            raise GripperTimeoutError(late, messages.REMEDY_LATE())
        # From one request to the next: the exchange is part of the period.
        await asyncio.sleep(max(0.0, asked_s + _POLL_S - time.monotonic()))

    def _active_fault(self, status: Status, now_s: float) -> int:
        if status.fault != _NO_COMMUNICATION:
            return status.fault
        if self._mute_since_s is None:
            self._mute_since_s = now_s
        return status.fault if now_s - self._mute_since_s > _MUTE_GRACE_S else 0

    def _reading(self, status: Status, at_s: float) -> GripperReading:
        state = _OBJECT_STATES[status.object_] if status.go_to else ObjectState.IDLE
        if state == ObjectState.AT_POSITION and self._held_request == status.echo:
            state = ObjectState.LOST
        return GripperReading(
            width_mm=width_of_count(status.position, self._calibration),
            position_count=status.position,
            object_state=state,
            active=status.state == State.ACTIVE,
            fault_code=status.fault,
            current_a=status.current_a,
            at_s=at_s,
        )


def _late_at(step: Message, status: Status) -> Message:
    state = _OBJECT_STATES[status.object_] if status.go_to else ObjectState.IDLE
    return messages.LATE_AT(step=step, count=status.position, state=_STATE_MESSAGES[state])


def make_gripper(settings: GripperSettings, stopped: Callable[[], Awaitable[bool]] = emergency_stopped) -> Robotiq2F85:
    """Make the gripper of the settings; nothing is sent yet. Whether its robot is `stopped` see `UrcapLink`."""
    if settings.driver == "urcap":
        return Robotiq2F85(UrcapLink(settings.urcap, settings.answer_timeout_s, stopped), settings)
    return Robotiq2F85(ModbusRtuLink(settings.modbus_rtu, settings.answer_timeout_s), settings)

"""Device monitor: checks one device periodically, and stores the time of its last answer and its fault."""

import asyncio
import contextlib
import logging
import time
from collections.abc import Awaitable, Callable

from station.devices.arm.faults import ArmFault
from station.errors import StationError
from station.messages import device as messages
from station.messages.message import Message
from station.messages.operation import internal_fault

PERIOD_S = 0.25
FIRST_PAUSE_S = 0.25
MEETING_S = 15.0
"""A device's time to become healthy after the start, before an operator sees its fault: an estimate."""

log = logging.getLogger(__name__)

Check = Callable[[], Awaitable[None]]
"""Checks the device; raises its fault. It returns in time in any case. Any other error is a fault too."""


class NoAnswerYetError(StationError):
    """The device has not answered since the start."""


class DeviceMonitor:
    """Monitor task of one device. It runs for ever, with growing pauses while the device is away.

    Args:
        name: of the device, as in the log; its title is what a person reads.
        on_change: gets the fault from now on, None for no fault.
        on_progress: called after each check, healthy or not, in long pauses, and while an inspection uses the device.
    """

    def __init__(
        self,
        name: str,
        title: Message,
        check: Check,
        longest_pause_s: float,
        on_change: Callable[[StationError | None], None],
        on_progress: Callable[[], None],
    ) -> None:
        self.name = name
        self.fault: StationError | None = NoAnswerYetError(messages.NO_ANSWER_YET(device=title))
        self.heard_s: float | None = None
        """Monotonic time of the last check that found the device healthy."""
        self._in_use = False
        self._check, self._longest_pause_s = check, longest_pause_s
        self._on_change, self._on_progress = on_change, on_progress
        self._again = asyncio.Event()
        self._began_s = time.monotonic()

    @property
    def is_decided(self) -> bool:
        """Return whether an operator has to see its fault, or that it has none; until then the alarms stay as they are.

        A device has some time to answer after the start.
        """
        return self.heard_s is not None or time.monotonic() >= self._began_s + MEETING_S

    @property
    def age_s(self) -> float | None:
        """Return the time since it was last found healthy; None if it never was."""
        return None if self.heard_s is None else time.monotonic() - self.heard_s

    def use(self, *, by_inspection: bool) -> None:
        """Leave the device to an inspection, which reports its faults, or check it again."""
        self._in_use = by_inspection

    def report_success(self) -> None:
        """Note that a caller has just worked with the device successfully."""
        self.heard_s = time.monotonic()
        self._on_progress()

    def report_fault(self, fault: StationError) -> None:
        """Note a fault that a caller met; the next check follows at once."""
        self._set(fault)
        self._again.set()

    def check_now(self) -> None:
        """Check again at once, after a repair, without waiting for the next check's time."""
        self._again.set()

    async def run(self) -> None:
        """Check until cancelled."""
        pause_s = PERIOD_S
        while True:
            if self._in_use:
                self._on_progress()
            else:
                try:
                    await self._check()
                except Exception as error:  # noqa: BLE001 (whatever it is, the device is checked again)
                    pause_s = FIRST_PAUSE_S if self.fault is None else min(2 * pause_s, self._longest_pause_s)
                    self._set(_fault_of(error))
                    self._on_progress()
                else:
                    pause_s = PERIOD_S
                    self.report_success()
                    self._set(None)
            await self._pause(pause_s)

    async def _pause(self, pause_s: float) -> None:
        until_s = time.monotonic() + pause_s
        self._again.clear()
        # In pieces, each of which is progress: a long pause must not count as stuck.
        while (left_s := until_s - time.monotonic()) > 0:
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(min(left_s, PERIOD_S)):
                    await self._again.wait()
            if self._again.is_set():
                return
            self._on_progress()

    def _set(self, fault: StationError | None) -> None:
        before, self.fault = self.fault, fault
        if (before and before.message) != (fault and fault.message):
            level, text = (logging.WARNING, fault.message) if fault else (logging.INFO, "healthy")
            log.log(level, "%s: %s", self.name, text)
        if _kind(before) != _kind(fault):
            self._on_change(fault)


def _fault_of(error: Exception) -> StationError:
    """A check's error as the device's fault; one that no driver should raise is logged with its traceback."""
    if isinstance(error, StationError):
        return error
    log.error("an unexpected error in the check of a device", exc_info=error)
    return StationError(internal_fault(error))


def _kind(fault: StationError | None) -> object:
    """Return a fault's type, and an arm fault's cause: the cycle reacts if these change, not if the text alone does."""
    return (type(fault), fault.cause if isinstance(fault, ArmFault) else None)

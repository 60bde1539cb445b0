"""Simulated devices: how long a request takes under the troubles of now, and with which real error it fails."""

import random
from collections.abc import Iterable
from typing import Literal

from station.devices.arm.faults import ArmCause, ArmFault
from station.devices.camera.interface import CameraError
from station.devices.gripper.errors import GripperLinkLostError, GripperProtocolError
from station.errors import StationError
from station.messages.message import verbatim
from station.records.errors import DiskFullError

from .clock import Clock
from .story import ARM_STOPS, Trouble

Part = Literal["arm", "gripper", "camera", "vision", "disk"]
_WORDS = verbatim("by the story")
_INTERMITTENT = 0.3
_SLOW = 6.0
_DELAY_S = 2.5
_DRIVER_DEADLINE_S = 8.0
"""After which a driver gives up a device that does not answer; the cycle's own deadline is mostly shorter."""
_FAILS = {"off", "garbage", "full", *ARM_STOPS}


class Devices:
    """All devices of a cell, the disk and the vision worker among them."""

    def __init__(self, clock: Clock, rng: random.Random, troubles: Iterable[Trouble]) -> None:
        self._clock, self._rng = clock, rng
        self._troubles: dict[str, list[Trouble]] = {}
        for trouble in troubles:
            self._troubles.setdefault(trouble.part, []).append(trouble)
        self._delayed: set[Trouble] = set()

    def trouble(self, part: str) -> str | None:
        """Return the kind of trouble that a part has now."""
        for trouble in self._troubles.get(part, ()):
            if trouble.at_s <= self._clock.s < trouble.at_s + trouble.lasts_s:
                if trouble.kind != "delayed":
                    return trouble.kind
                if trouble not in self._delayed:  # one answer only
                    self._delayed.add(trouble)
                    return trouble.kind
        return None

    def request(self, part: Part, takes_s: float) -> tuple[float, Exception | None]:
        """Return how long a request takes, and what it fails with."""
        kind, takes_s = self.trouble(part), takes_s * self._rng.uniform(0.8, 1.2)
        if kind in _FAILS and not (part == "camera" and kind == "garbage"):
            return takes_s / 2, self._fault(part, kind or "")
        if kind == "intermittent" and self._rng.random() < _INTERMITTENT:
            return takes_s / 2, self._fault(part, kind)
        if kind == "stuck":
            return _DRIVER_DEADLINE_S, self._fault(part, kind)
        factor = _SLOW if kind == "slow" else 1.0
        return factor * takes_s + (_DELAY_S if kind == "delayed" else 0.0), None

    def standing(self, part: Part) -> StationError | None:
        """Return the fault that a part's monitor sees now."""
        kind = self.trouble(part) if part != "vision" else None
        fault = self._fault(part, kind) if kind in _FAILS and kind is not None and kind != "garbage" else None
        return fault if isinstance(fault, StationError) else None

    @staticmethod
    def _fault(part: Part, kind: str) -> Exception:
        if part == "arm":
            return ArmFault(ArmCause(kind) if kind in ARM_STOPS else ArmCause.LINK_LOST, _WORDS)
        if part == "gripper":
            return (GripperProtocolError if kind == "garbage" else GripperLinkLostError)(_WORDS, _WORDS)
        if part == "camera":
            return CameraError(_WORDS)
        if part == "disk":
            return DiskFullError(_WORDS, _WORDS)
        return RuntimeError("the vision worker failed")

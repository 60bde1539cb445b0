"""The socket that Robotiq's URCap opens on a UR controller, TCP 63352.

`SET VAR n [VAR n ...]` is answered by `ack` without a newline, `GET VAR` by `VAR n` with one, and by `VAR ?` while
emergency stopped. What the real one answers to nonsense is unverified on hardware; here it is `?`.
"""

import asyncio
from dataclasses import fields, replace
from typing import Any

from station.twin.robotiq.faults import GripperFault
from station.twin.robotiq.listener import Listener, disturbed
from station.twin.robotiq.registers import Command

_WRITABLE = {
    "ACT": "activate",
    "GTO": "go_to",
    "ATR": "release",
    "ARD": "release_opens",
    "POS": "position",
    "SPE": "speed",
    "FOR": "force",
}
_READ_ONLY = {"STA": "state", "PRE": "echo", "OBJ": "object_", "FLT": "fault", "POS": "position"}
_LARGEST = {field.name: 1 if field.type is bool else 255 for field in fields(Command)}
_LONGEST_NUMBER = 3
_NONSENSE = b"?\n"


class UrcapServer(Listener):
    """The socket in front of one gripper."""

    async def _session(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while True:
            try:
                line = await reader.readuntil(b"\n")
            except (asyncio.IncompleteReadError, asyncio.LimitOverrunError):
                return
            writer.write(await disturbed(self._answer(line), self._gripper.faults))
            await writer.drain()

    def _answer(self, line: bytes) -> bytes:
        words = line.decode("ascii", errors="replace").split()
        if words[:1] == ["SET"]:
            return self._set(words[1:])
        if words[:1] == ["GET"] and len(words) == 2:
            return self._get(words[1])
        return _NONSENSE

    def _set(self, words: list[str]) -> bytes:
        changes: dict[str, Any] = {}
        for name, text in zip(words[::2], words[1::2], strict=False):
            field = _WRITABLE.get(name)
            # The length is checked before int(), which raises ValueError for thousands of digits.
            if field is None or not text.isdecimal() or len(text) > _LONGEST_NUMBER or int(text) > _LARGEST[field]:
                return _NONSENSE
            changes[field] = bool(int(text)) if _LARGEST[field] == 1 else int(text)
        if not changes or len(words) % 2:
            return _NONSENSE
        self._gripper.write(replace(self._gripper.command, **changes))
        return b"ack"

    def _get(self, name: str) -> bytes:
        # POS is in both: GET reads where the fingers are, and PRE what was requested.
        if name in _READ_ONLY:
            value = int(getattr(self._gripper.status(), _READ_ONLY[name]))
        elif name in _WRITABLE:
            value = int(getattr(self._gripper.command, _WRITABLE[name]))
        else:
            return _NONSENSE
        stopped = self._gripper.faults.active(GripperFault.EMERGENCY_STOPPED)
        return f"{name} {'?' if stopped else value}\n".encode()

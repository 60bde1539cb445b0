"""Arm check of `station devices check`: reads the controller and changes nothing."""

import asyncio
import struct
import time
from itertools import pairwise

from station.devices.arm.dashboard import DashboardFacts, dashboard
from station.devices.arm.faults import REMEDIES, ArmCause, ArmFault
from station.devices.check_result import CheckResult
from station.messages import arm as messages
from station.settings.arm import ArmSettings

RTDE_PORT = 30004
SCRIPT_PORT = 30003
PORT_DEADLINE_S = 2.5
LATE_S = 0.3
"""A stream is late if every request, too, is answered later than this: a pause of a busy machine delays but one."""
FROZEN_S = 1.0
"""A stream is frozen if its clock has not advanced for so long from its start."""
STREAM_HZ = 125.0
HEADER = struct.Struct(">HB")
CLAIM = b"input_int_register_23,input_double_register_23"
"""A fieldbus may own registers 0 to 23. ur-rtde uses integers 0 to 7 and doubles 0 to 17: claiming one of those, even
shortly, would refuse a station that connects at that moment."""
LONGEST_WORD = 120


async def probe_arm(settings: ArmSettings) -> list[CheckResult]:
    """Check the controller's dashboard, RTDE and script servers. It moves nothing, starts nothing and never raises."""
    try:
        async with dashboard(settings.host) as conversation:
            facts = await conversation.facts()
    except ArmFault as fault:
        return [CheckResult("arm", fault.detail, "fault", messages.REMEDY_HOST())]
    return [_controller(settings.host, facts), await _rtde(settings.host), await _script(settings.host)]


def _controller(host: str, facts: DashboardFacts) -> CheckResult:
    found = messages.CHECK_CONTROLLER(
        model=_short(facts.model),
        host=host,
        serial=_short(facts.serial_number),
        version=_short(facts.version),
        mode=_short(facts.robot_mode),
        safety=_short(facts.safety_status),
        control=messages.CHECK_REMOTE() if facts.remote else messages.CHECK_LOCAL(),
    )
    cause = _cause(facts)
    if cause is None:
        return CheckResult("arm controller", found, "ok")
    return CheckResult("arm controller", found, "fault", REMEDIES[cause])


def _cause(facts: DashboardFacts) -> ArmCause | None:
    status = facts.safety_status
    if "EMERGENCY_STOP" in status:
        return ArmCause.EMERGENCY_STOP
    if "PROTECTIVE_STOP" in status:
        return ArmCause.PROTECTIVE_STOP
    if "SAFEGUARD" in status:
        return ArmCause.SAFEGUARD_STOP
    if status not in {"NORMAL", "REDUCED"}:
        return ArmCause.SAFETY_FAULT
    if not facts.remote:
        return ArmCause.LOCAL_CONTROL
    return None if facts.robot_mode == "RUNNING" else ArmCause.NOT_POWERED


def _short(words: str) -> str:
    """Cut a peer's text to one line, without control characters."""
    legible = "".join(letter if letter.isprintable() else "?" for letter in words)
    return legible if len(legible) <= LONGEST_WORD else f"{legible[: LONGEST_WORD - 1]}…"


async def _rtde(host: str) -> CheckResult:
    """Request protocol version 2, the registers of a fieldbus, and the clock; the claim ends with the connection."""
    place, connected = f"{host}:{RTDE_PORT}", False
    try:
        async with asyncio.timeout(PORT_DEADLINE_S):
            reader, writer = await asyncio.open_connection(host, RTDE_PORT)
            connected = True
            try:
                requests = (
                    (b"V", struct.pack(">H", 2)),
                    (b"v", b""),
                    (b"I", CLAIM),
                    (b"O", struct.pack(">d", STREAM_HZ) + b"timestamp"),
                )
                answers, times_s = [], [time.monotonic()]
                for kind, payload in requests:
                    answers.append(await _exchange(reader, writer, kind, payload))
                    times_s.append(time.monotonic())
                accepted, version, kinds, _ = answers
                numbers = struct.unpack(">4I", version)
                in_time = min(after_s - before_s for before_s, after_s in pairwise(times_s)) <= LATE_S
                fresh = in_time and await _advances(reader, writer)
            finally:
                writer.transport.abort()
    except (TimeoutError, OSError, asyncio.IncompleteReadError, struct.error) as error:
        if not connected:
            return CheckResult("arm RTDE", messages.CHECK_NO_ANSWER(address=place), "fault", messages.REMEDY_HOST())
        late = isinstance(error, TimeoutError)
        found = (
            messages.CHECK_RTDE_LATE(address=place, limit_s=PORT_DEADLINE_S)
            if late
            else messages.CHECK_RTDE_CLOSES(address=place)
        )
        return CheckResult("arm RTDE", found, "fault", messages.REMEDY_FROZEN())
    named = {"address": place, "version": ".".join(map(str, numbers))}
    if accepted[:1] != b"\x01":
        return CheckResult("arm RTDE", messages.CHECK_RTDE_REFUSES(**named), "fault", messages.REMEDY_UPDATE())
    if not fresh:
        frozen = messages.CHECK_RTDE_FROZEN(**named, limit_s=LATE_S)
        return CheckResult("arm RTDE", frozen, "fault", messages.REMEDY_FROZEN())
    if b"IN_USE" in kinds:
        remedy = REMEDIES[ArmCause.REGISTERS_IN_USE]
        return CheckResult("arm RTDE", messages.CHECK_RTDE_REGISTERS(**named), "warning", remedy)
    return CheckResult("arm RTDE", messages.CHECK_RTDE(**named), "ok")


async def _advances(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> bool:
    """Start the stream and check that it gives two different timestamps in time."""
    try:
        async with asyncio.timeout(FROZEN_S):
            await _exchange(reader, writer, b"S", b"")
            first = await _package(reader, b"U")
            while await _package(reader, b"U") == first:
                pass
    except TimeoutError:
        return False
    return True


async def _exchange(reader: asyncio.StreamReader, writer: asyncio.StreamWriter, kind: bytes, payload: bytes) -> bytes:
    writer.write(HEADER.pack(HEADER.size + len(payload), kind[0]) + payload)
    await writer.drain()
    return await _package(reader, kind)


async def _package(reader: asyncio.StreamReader, kind: bytes) -> bytes:
    """Return the payload of the next package of a kind."""
    while True:
        size, answered = HEADER.unpack(await reader.readexactly(HEADER.size))
        answer = await reader.readexactly(max(0, size - HEADER.size))
        if answered == kind[0]:
            return answer


async def _script(host: str) -> CheckResult:
    address = f"{host}:{SCRIPT_PORT}"
    try:
        async with asyncio.timeout(PORT_DEADLINE_S):
            _, writer = await asyncio.open_connection(host, SCRIPT_PORT)
    except (TimeoutError, OSError):
        found = messages.CHECK_NO_PROGRAMS(address=address)
        return CheckResult("arm programs", found, "fault", messages.REMEDY_HOST())
    writer.transport.abort()
    return CheckResult("arm programs", messages.CHECK_PROGRAMS(address=address), "ok")

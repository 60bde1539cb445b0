"""A look at the arm's controller that changes nothing: what `station devices check` shows of it."""

import asyncio
import struct

from station.devices.arm.dashboard import DashboardFacts, dashboard
from station.devices.arm.faults import REMEDIES, ArmCause, ArmFault
from station.devices.finding import Finding
from station.settings.arm import ArmSettings

RTDE_PORT = 30004
SCRIPT_PORT = 30003
PORT_DEADLINE_S = 2.5
HEADER = struct.Struct(">HB")
CLAIM = b"input_int_register_0,input_double_register_0"


async def probe_arm(settings: ArmSettings) -> list[Finding]:
    """Ask the controller's dashboard, RTDE and script servers. It moves nothing, starts nothing and never raises.

    Args:
        settings: where the controller is.
    """
    try:
        async with dashboard(settings.host) as conversation:
            facts = await conversation.facts()
    except ArmFault as fault:
        return [Finding("arm", fault.detail, "fault", fault.remedy)]
    return [_controller(settings.host, facts), await _rtde(settings.host), await _script(settings.host)]


def _controller(host: str, facts: DashboardFacts) -> Finding:
    found = (
        f"{facts.model} at {host}, serial number {facts.serial_number}, PolyScope {facts.version}: {facts.robot_mode}, "
        f"safety {facts.safety_status}, {'remote' if facts.remote else 'local'} control"
    )
    cause = _cause(facts)
    if cause is None:
        return Finding("arm controller", found, "ok", "")
    return Finding("arm controller", found, "fault", REMEDIES[cause])


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


async def _rtde(host: str) -> Finding:
    """Ask for protocol version 2 and for the control program's registers; the claim ends with the connection."""
    try:
        async with asyncio.timeout(PORT_DEADLINE_S):
            reader, writer = await asyncio.open_connection(host, RTDE_PORT)
            try:
                accepted = await _exchange(reader, writer, b"V", struct.pack(">H", 2))
                version = struct.unpack(">4I", await _exchange(reader, writer, b"v", b""))
                kinds = await _exchange(reader, writer, b"I", CLAIM)
            finally:
                writer.transport.abort()
    except (TimeoutError, OSError, asyncio.IncompleteReadError, struct.error):
        remedy = REMEDIES[ArmCause.LINK_LOST]
        return Finding("arm RTDE", f"nobody speaks RTDE at {host}:{RTDE_PORT}", "fault", remedy)
    found = f"RTDE at {host}:{RTDE_PORT}, controller {'.'.join(map(str, version))}"
    if accepted[:1] != b"\x01":
        return Finding("arm RTDE", f"{found}, refuses protocol 2", "fault", "Update the controller's software.")
    if b"IN_USE" in kinds:
        remedy = f"If the station is running, it is the client. If not: {REMEDIES[ArmCause.REGISTERS_IN_USE]}"
        return Finding("arm RTDE", f"{found}, its input registers are in use", "warning", remedy)
    return Finding("arm RTDE", found, "ok", "")


async def _exchange(reader: asyncio.StreamReader, writer: asyncio.StreamWriter, kind: bytes, payload: bytes) -> bytes:
    writer.write(HEADER.pack(HEADER.size + len(payload), kind[0]) + payload)
    await writer.drain()
    while True:
        size, answered = HEADER.unpack(await reader.readexactly(HEADER.size))
        answer = await reader.readexactly(max(0, size - HEADER.size))
        if answered == kind[0]:
            return answer


async def _script(host: str) -> Finding:
    try:
        async with asyncio.timeout(PORT_DEADLINE_S):
            _, writer = await asyncio.open_connection(host, SCRIPT_PORT)
    except (TimeoutError, OSError):
        found = f"nobody takes programs at {host}:{SCRIPT_PORT}"
        return Finding("arm programs", found, "fault", REMEDIES[ArmCause.LINK_LOST])
    writer.transport.abort()
    return Finding("arm programs", f"programs are taken at {host}:{SCRIPT_PORT}", "ok", "")

"""Modbus RTU as a slave sees it: requests cut out of a byte stream, and the answer to each.

Written here and not taken from pymodbus, whose client the station's driver uses: two ends that share a framer would
share its mistakes. Source: Modbus over serial line V1.02 (frame, CRC) and Modbus application protocol V1.1b3.
"""

from collections.abc import Callable
from struct import pack, unpack

from station.twin.robotiq.model import RobotiqGripper

UNIT = 9
LONGEST_FRAME = 256
_SILENCE_S = 0.05
"""A pause that ends a frame. The standard's 3.5 characters (0.3 ms at 115200 baud) do not survive TCP or a pty."""

_READ, _READ_INPUT, _WRITE, _READ_WRITE = 0x03, 0x04, 0x10, 0x17
_ILLEGAL_FUNCTION, _ILLEGAL_ADDRESS, _ILLEGAL_VALUE = 0x01, 0x02, 0x03
_LONGEST_WRITE = 123
_LONGEST_READ = 125


def crc16(data: bytes) -> bytes:
    """The CRC of a frame, low byte first as it goes over the wire (polynomial 0xA001, start 0xFFFF)."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ (0xA001 if crc & 1 else 0)
    return pack("<H", crc)


def framed(body: bytes) -> bytes:
    """Unit, function and data with their CRC."""
    return body + crc16(body)


class RequestFramer:
    """Cuts requests out of what arrives in pieces; what is no frame is dropped up to the next silence."""

    def __init__(self) -> None:
        self._buffer = b""
        self._last_s = 0.0

    def feed(self, data: bytes, now_s: float) -> list[bytes]:
        """Take bytes at their monotonic time of arrival; return the whole frames without their CRC, in order."""
        if now_s - self._last_s > _SILENCE_S:
            self._buffer = b""
        self._last_s = now_s
        self._buffer += data
        frames: list[bytes] = []
        while (length := self._length()) and len(self._buffer) >= length:
            frame, self._buffer = self._buffer[:length], self._buffer[length:]
            if crc16(frame[:-2]) != frame[-2:]:
                self._buffer = b""
                break
            frames.append(frame[:-2])
        if len(self._buffer) > LONGEST_FRAME:
            self._buffer = b""
        return frames

    def _length(self) -> int:
        """The length of the frame that the buffer begins with, 0 while it is unknown."""
        if len(self._buffer) < 2:
            return 0
        # Both functions that write have a byte count; a request to read has two words, 8 bytes with its CRC.
        counter_at = {_WRITE: 6, _READ_WRITE: 10}.get(self._buffer[1])
        if counter_at is not None:
            return counter_at + 1 + self._buffer[counter_at] + 2 if len(self._buffer) > counter_at else 0
        return 8


def answer(request: bytes, gripper: RobotiqGripper) -> bytes | None:
    """The framed answer to a request without CRC; None where a slave stays silent because another unit is meant."""
    if request[0] != UNIT:
        return None
    function = request[1]
    handler = _HANDLERS.get(function)
    if handler is None:
        return _refused(function, _ILLEGAL_FUNCTION)
    try:
        return framed(bytes((UNIT, function)) + handler(request[2:], gripper))
    except KeyError:
        return _refused(function, _ILLEGAL_ADDRESS)
    except ValueError:
        return _refused(function, _ILLEGAL_VALUE)


def _refused(function: int, reason: int) -> bytes:
    return framed(bytes((UNIT, function | 0x80, reason)))


def _read(data: bytes, gripper: RobotiqGripper) -> bytes:
    address, count = unpack(">HH", data)
    if not 1 <= count <= _LONGEST_READ:
        raise ValueError(count)
    values = [gripper.read_register(address + offset) for offset in range(count)]
    return pack(f">B{count}H", 2 * count, *values)


def _write(data: bytes, gripper: RobotiqGripper) -> bytes:
    address, count, size = unpack(">HHB", data[:5])
    if not 1 <= count <= _LONGEST_WRITE or size != 2 * count:
        raise ValueError(count)
    gripper.write_registers(address, list(unpack(f">{count}H", data[5:])))
    return data[:4]


def _read_write(data: bytes, gripper: RobotiqGripper) -> bytes:
    """The write comes first, as the standard has it for function 23, but only if the read will not be refused."""
    _read(data[:4], gripper)
    _write(data[4:], gripper)
    return _read(data[:4], gripper)


_HANDLERS: dict[int, Callable[[bytes, RobotiqGripper], bytes]] = {
    _READ: _read,
    _READ_INPUT: _read,
    _WRITE: _write,
    _READ_WRITE: _read_write,
}

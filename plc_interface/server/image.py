"""Register image: the registers' content, and the decoding of writes."""

import struct
from collections.abc import Mapping

from plc_interface.registers.codec import RegisterValueError, WordOrder, decode, encode, problem
from plc_interface.registers.map import BY_NAME, MAP_VERSION, QUEUE_PLACES, REFERENCES, REGISTERS, map_checksum
from plc_interface.registers.register import Access, Kind, Register, Value
from plc_interface.server.exceptions import illegal_address, illegal_value

_END = REGISTERS[-1].end
_AT = {register.address: register for register in REGISTERS}


def _addresses(*, of: Access | None = None, kind: Kind | None = None) -> bytes:
    """Return one byte per address: 1 for a register of this access and kind."""
    marks = bytearray(_END)
    for register in REGISTERS:
        if of in {None, register.access} and kind in {None, register.kind}:
            marks[register.address : register.end] = b"\1" * register.words
    return bytes(marks)


_LEFT_TO_THE_HANDSHAKE = frozenset({"lot", "command_code"})
"""A PLC writes them in each scan. A wrong value fails only the bit that uses it, because refusing the whole write would
also refuse the heartbeat."""
_MAPPED, _WRITABLE, _FLAGS = _addresses(), _addresses(of=Access.READ_WRITE), _addresses(kind=Kind.BITS)


class RegisterImage:
    """Every register of the map, as bytes on the wire.

    Used from the event loop alone: a commit is one synchronous slice and a read another, so no read is torn.
    """

    def __init__(self, order: WordOrder = WordOrder.HIGH_FIRST) -> None:
        """Start with zeros and empty texts, except the reference values and the map's own version."""
        self._order = order
        self._wire = bytearray(2 * _END)
        self._values: dict[str, Value] = {
            register.name: "" if register.kind is Kind.TEXT else 0 for register in REGISTERS
        }
        self.commit(
            {
                **REFERENCES,
                "map_version": MAP_VERSION,
                "map_checksum": map_checksum(),
                "queue_places": QUEUE_PLACES,
            }
        )

    def commit(self, values: Mapping[str, Value]) -> None:
        """Set registers by name, all at once or none; None for a register's own "there is none", of a text NUL.

        Raises:
            KeyError: a name that the map does not have.
            RegisterValueError: a value that its register cannot hold.
        """
        slices = [(BY_NAME[name].address, self._encoded(BY_NAME[name], value)) for name, value in values.items()]
        for address, words in slices:
            struct.pack_into(f">{len(words)}H", self._wire, 2 * address, *words)
        self._values.update(values)

    def value(self, name: str) -> Value:
        """Return a register's present value; KeyError for a name that the map does not have."""
        return self._values[name]

    def registers(self, address: int, count: int) -> bytes:
        """Return registers as on the wire, two bytes each.

        Raises:
            RequestError: 02 if one of them is not in the map.
        """
        end = address + count
        if end > _END or _MAPPED.find(0, address, end) >= 0:
            raise illegal_address(f"registers {address} to {end - 1} are not all in the map")
        return bytes(self._wire[2 * address : 2 * end])

    def bits(self, address: int, count: int) -> bytes:
        """Return flags as on the wire: eight a byte, the first in the lowest bit; see `bit_address`.

        Raises:
            RequestError: 02 if one of them is not in a register of 16 flags.
        """
        first, last = address // 16, (address + count - 1) // 16
        if last >= _END or _FLAGS.find(0, first, last + 1) >= 0:
            raise illegal_address(f"bits {address} to {address + count - 1} are not all flags of the map")
        words = self._words(first, last + 1 - first)
        every = sum(word << 16 * position for position, word in enumerate(words))
        return (every >> address % 16 & (1 << count) - 1).to_bytes((count + 7) // 8, "little")

    def written(self, address: int, raw: bytes) -> dict[str, Value]:
        """Return the fields of a write to registers, two bytes each; nothing is changed.

        A lot that is not printable ASCII is None, and a command code may be one that does not exist.

        Raises:
            RequestError: 02 if a register is read-only or not in the map, 03 if a field would be half written or does
                not accept the value.
        """
        words = struct.unpack(f">{len(raw) // 2}H", raw)
        end = address + len(words)
        if end > _END or _WRITABLE.find(0, address, end) >= 0:
            raise illegal_address(f"registers {address} to {end - 1} are not all in the map and writable")
        values: dict[str, Value] = {}
        position = address
        while position < end:
            register = _AT.get(position)
            if register is None or register.end > end:
                raise illegal_value(f"registers {address} to {end - 1} would write half a value: write it whole")
            values[register.name] = self._decoded(register, words[position - address : register.end - address])
            position = register.end
        return values

    def written_bits(self, address: int, count: int, bits: int) -> dict[str, Value]:
        """Return the fields of a write to flags, the first in the lowest bit; nothing is changed.

        Raises:
            RequestError: as `written`.
        """
        # For its check of the addresses only.
        self.bits(address, count)
        first, last = address // 16, (address + count - 1) // 16
        words = self._words(first, last + 1 - first)
        every = sum(word << 16 * position for position, word in enumerate(words))
        mask = (1 << count) - 1 << address % 16
        every = every & ~mask | bits << address % 16 & mask
        changed = [every >> 16 * position & 0xFFFF for position in range(len(words))]
        return self.written(first, struct.pack(f">{len(changed)}H", *changed))

    def word(self, address: int) -> int:
        """Return one register's content.

        Raises:
            RequestError: 02 if it is not in the map.
        """
        return int.from_bytes(self.registers(address, 1), "big")

    def _words(self, address: int, count: int) -> tuple[int, ...]:
        return struct.unpack_from(f">{count}H", self._wire, 2 * address)

    def _encoded(self, register: Register, value: Value) -> tuple[int, ...]:
        return encode(register, "" if value is None and register.kind is Kind.TEXT else value, self._order)

    def _decoded(self, register: Register, words: tuple[int, ...]) -> Value:
        left = register.name in _LEFT_TO_THE_HANDSHAKE
        try:
            value = decode(register, words, self._order)
        except RegisterValueError as error:
            if left:
                return None
            raise illegal_value(str(error)) from error
        if not left and (why := problem(register, value)):
            raise illegal_value(why)
        return value

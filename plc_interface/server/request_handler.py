"""Request handler: from a request to its response, by all checks, the handshake and the registers.

Synchronous: between two requests, and between a request and its response, nothing else runs.
"""

from collections.abc import Callable, Mapping
from functools import partial

from plc_interface.registers.bits import WRITE_KEY
from plc_interface.registers.register import Value
from plc_interface.server import identification, reading, writing
from plc_interface.server.exceptions import ExceptionCode, RequestError, Trouble, illegal_function
from plc_interface.server.image import RegisterImage
from plc_interface.server.peer import Peer

OnWrite = Callable[[Peer, Mapping[str, Value]], None]
"""Called with the writer's whole fields after every check and before they are in the image."""

Claim = Callable[[Peer], bool]
"""Takes or renews the right to write; False where another client has it."""

_WRITING: Mapping[int, writing.Parser] = {
    5: writing.write_coil,
    6: writing.write_register,
    15: writing.write_coils,
    16: writing.write_registers,
    22: writing.mask_write_register,
    23: writing.read_write_registers,
}
_KEY = "write_key"

THE_SERVER_ITSELF = (0, 255)
"""Unit identifiers by which a client means the server at the address, no device behind a gateway: Modbus Messaging on
TCP/IP Implementation Guide V1.0b, 4.4.1.2. There is no broadcast on TCP."""


class RequestHandler:
    """Handles the requests to one unit."""

    def __init__(
        self,
        unit: int,
        image: RegisterImage,
        on_write: OnWrite,
        claim: Claim,
        owns: Callable[[Peer], bool],
        release: Callable[[], None],
    ) -> None:
        """Answer from an image.

        Args:
            unit: the valid unit identifier beside those of the server itself.
            image: read, and written after `on_write` has returned.
            owns: whether a client has the right to write.
            release: called after the writer has released the right to write.
        """
        self._unit, self._image = unit, image
        self._on_write, self._claim, self._owns, self._release = on_write, claim, owns, release
        self._reading: Mapping[int, Callable[[bytes], bytes]] = {
            1: partial(reading.read_bits, image),
            2: partial(reading.read_bits, image),
            3: partial(reading.read_registers, image),
            4: partial(reading.read_registers, image),
            43: identification.identify,
        }

    def respond(self, peer: Peer, unit: int, message: bytes) -> bytes:
        """Return the response to a PDU of one byte or more, both from the function code on.

        Raises:
            RequestError: the request is answered with an exception.
        """
        if unit not in {self._unit, *THE_SERVER_ITSELF}:
            why = f"unit {unit} was asked, this is unit {self._unit}"
            raise RequestError(ExceptionCode.GATEWAY_NO_RESPONSE, Trouble.UNKNOWN_UNIT, why)
        read = self._reading.get(message[0])
        if read is not None:
            return read(message)
        parse = _WRITING.get(message[0])
        if parse is None:
            raise illegal_function(f"function {message[0]} is not served")
        if not peer.may_write:
            why = "it may read only: see modbus.writers, or with TLS its certificate's role"
            raise RequestError(ExceptionCode.ILLEGAL_FUNCTION, Trouble.NO_RIGHT, why)
        return self._write(peer, parse(self._image, message))

    def _write(self, peer: Peer, write: writing.Write) -> bytes:
        gives_back = _KEY in write.values and self._owns(peer)
        key = write.values.get(_KEY, self._image.value(_KEY))
        if key != WRITE_KEY and write.values.keys() != {_KEY} and not gives_back:
            why = f"{_KEY} is not set: write {WRITE_KEY:#06x} there before, or in the same request"
            raise RequestError(ExceptionCode.BUSY, Trouble.NOT_WRITER, why)
        if not self._claim(peer):
            raise RequestError(ExceptionCode.BUSY, Trouble.NOT_WRITER, "another client holds the right to write")
        self._on_write(peer, write.values)
        self._image.commit(write.values)
        # Last: a scan that gives the right back is carried out whole, as its owner's.
        if self._image.value(_KEY) != WRITE_KEY:
            self._release()
        return write.response()

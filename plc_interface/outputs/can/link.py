"""An open CAN bus with canopen's network on it, and the receiving thread.

python-can's own Notifier is not used: its thread ends at the first exception without a report (decision 14).
"""

import errno
import logging
import struct
import threading
import time
from collections import Counter
from collections.abc import Callable
from typing import Any, NamedTuple

import can
import canopen

from plc_interface.outputs.can.errors import BusOffError, InterfaceError
from station.messages import can as messages
from station.messages.message import Definition, Message
from station.settings.can import CanSettings

_RECEIVE_S = 0.1
"""Longest wait for a frame; then the receiving thread checks whether it has to end. An estimate."""
_JOIN_S = 5.0
"""Longest wait for the end of the receiving thread. An estimate."""
_MOST_FAILURES = 10
"""In a row; a single bad datagram must not close the bus."""
_FAILURE_PAUSE_S = 0.02
"""Pause after a failed reception. An estimate."""
_BUS_OFF = 0x40
"""CAN_ERR_BUSOFF in an error frame's id (Linux, linux/can/error.h)."""
_NO_CAN = {errno.EAFNOSUPPORT, errno.EPROTONOSUPPORT}
HEARTBEAT = 0x700
"""Identifier of a node's heartbeat, to which its node id is added (CiA 301)."""
EMERGENCY = 0x80
"""Identifier of a node's emergency message, to which its node id is added (CiA 301)."""
_EMERGENCY = struct.Struct("<HB5x")
COUNT = struct.Struct("<I")
"""The encoder's TPDO 1: position."""
REPORT = struct.Struct("<HBI")
"""The gate's TPDO 1: sequence, fired, encoder count."""
ORDER = struct.Struct("<HBBI")
"""The gate's RPDO 1: sequence, lane, pulse in ms, encoder count."""

log = logging.getLogger(__name__)
for _library in ("can", "canopen"):
    logging.getLogger(_library).addHandler(logging.NullHandler())  # their reports are raised here as text


class Beat(NamedTuple):
    """A node's last heartbeat."""

    state: int
    """NMT state: 0 boot-up, 4 stopped, 5 operational, 127 pre-operational."""
    at_s: float
    """Monotonic."""


STATES = {0: "booting", 4: "stopped", 5: "operational", 127: "pre-operational"}


class Report(NamedTuple):
    """The gate's report of a reject actuation."""

    sequence: int
    """The lower 16 bits of the ordered one."""
    fired: int
    """0 armed, 1 fired, 2 late, 3 no place left, 4 bad order."""
    encoder_count: int
    """The encoder's count then."""


class Emergency(NamedTuple):
    """An emergency message."""

    node: int
    code: int
    register: int


def open_bus(settings: CanSettings) -> can.BusABC:
    """Open the interface. `socketcan` is unverified on hardware.

    Raises:
        InterfaceError: it does not exist, or cannot be opened on this machine.
    """
    options: dict[str, Any] = (
        {"port": settings.port, "hop_limit": 0, "fd": False} if settings.interface == "udp_multicast" else {}
    )
    try:
        return can.Bus(interface=settings.interface, channel=settings.channel, ignore_config=True, **options)
    except (can.CanError, OSError) as error:
        raise InterfaceError(
            messages.NOT_OPENED(bus=described(settings), error=_why(error), remedy=_remedy(settings, error))
        ) from error


def described(settings: CanSettings) -> Message:
    """Describe the interface."""
    if settings.interface == "udp_multicast":
        return messages.INTERFACE_PORT(interface=settings.interface, channel=settings.channel, port=settings.port)
    return messages.INTERFACE(interface=settings.interface, channel=settings.channel)


def _why(error: BaseException) -> str:
    cause = error.__cause__ or error
    return (cause.strerror if isinstance(cause, OSError) else None) or str(cause)


def _remedy(settings: CanSettings, error: Exception) -> Message:
    if settings.interface == "udp_multicast":
        return messages.DO_ROUTE()
    if isinstance(error, OSError) and error.errno in _NO_CAN:
        return messages.DO_KERNEL()
    return messages.DO_BRING_UP(channel=settings.channel, bitrate=str(settings.bitrate))


class CanLink:
    """The bus while it is open. Its received data can be read from any thread."""

    def __init__(
        self,
        settings: CanSettings,
        counters: Counter[str],
        on_report: Callable[[Report], object] = lambda _: None,
        on_emergency: Callable[[Emergency], object] = lambda _: None,
    ) -> None:
        """Open the bus and listen.

        Args:
            counters: receptions are counted here, by the receiving thread alone.
            on_report, on_emergency: called by the receiving thread.

        Raises:
            InterfaceError: the interface cannot be opened.
        """
        self._settings, self._counters = settings, counters
        self._on_report, self._on_emergency = on_report, on_emergency
        self.beats: dict[int, Beat] = {}
        self.count: tuple[int, float] | None = None
        """The encoder's last count and when it came, monotonic."""
        self._failure: InterfaceError | None = None
        self._ended = threading.Event()
        self._bus = open_bus(settings)
        self.network = canopen.Network(self._bus)
        for node in (settings.gate_node, settings.encoder_node):
            self.network.subscribe(HEARTBEAT + node, self._take_beat)
            self.network.subscribe(EMERGENCY + node, self._take_emergency)
        self.network.subscribe(0x180 + settings.encoder_node, self._take_count)
        self.network.subscribe(0x180 + settings.gate_node, self._take_report)
        self._thread = threading.Thread(target=self._receive, name="CAN receive", daemon=True)
        self._thread.start()

    def check(self) -> None:
        """Check that the bus still works.

        Raises:
            InterfaceError: the controller is bus-off, the interface fails, or the receiving thread has ended.
        """
        if self._failure:
            raise self._failure.again()
        if not self._thread.is_alive():
            raise InterfaceError(messages.DEAF(bus=described(self._settings)))

    def send(self, can_id: int, data: bytes) -> None:
        """Send one frame, with an identifier of 11 bits and at most 8 bytes.

        Raises:
            InterfaceError: the bus is closed or does not accept it.
        """
        if self._ended.is_set():
            raise InterfaceError(messages.CLOSED(bus=described(self._settings)))
        try:
            self.network.send_message(can_id, data)
        except (can.CanError, OSError, RuntimeError) as error:
            raise InterfaceError(self._failed(messages.NOT_SENDING, error)) from error

    def abort(self) -> None:
        """Stop receiving and sending, so that a thread that waits for a node ends soon."""
        self._ended.set()

    def close(self) -> None:
        """Stop listening and close the bus; waits for the thread. Idempotent."""
        self.abort()
        self._thread.join(_JOIN_S)
        self.network.disconnect()

    def _receive(self) -> None:
        failures = 0
        while not self._ended.is_set():
            try:
                message = self._bus.recv(_RECEIVE_S)
            except (can.CanError, OSError, ValueError) as error:
                self._counters["receive_errors"] += 1
                failures += 1
                if failures >= _MOST_FAILURES:
                    self._failure = InterfaceError(self._failed(messages.NOT_RECEIVING, error))
                    return
                self._ended.wait(_FAILURE_PAUSE_S)
                continue
            failures = 0
            if message is not None:
                self._take(message)

    def _failed(self, what: Definition, error: Exception) -> Message:
        return what(bus=described(self._settings), error=_why(error), remedy=_remedy(self._settings, error))

    def _take(self, message: can.Message) -> None:
        if message.is_error_frame:
            if message.arbitration_id & _BUS_OFF:
                self._counters["bus_off"] += 1
                self._failure = BusOffError(messages.BUS_OFF(bus=described(self._settings)))
            return
        if message.is_remote_frame:
            return
        self._counters["frames_received"] += 1
        try:
            self.network.notify(message.arbitration_id, message.data, message.timestamp)
        except Exception:  # an error in a reader must not stop reception
            self._counters["frames_malformed"] += 1
            log.debug("a frame 0x%X could not be read", message.arbitration_id, exc_info=True)

    def _take_beat(self, can_id: int, data: bytearray, _timestamp: float) -> None:
        (state,) = struct.unpack("B", data)
        self.beats[can_id - HEARTBEAT] = Beat(state & 0x7F, time.monotonic())

    def _take_count(self, _can_id: int, data: bytearray, _timestamp: float) -> None:
        self.count = (COUNT.unpack(data)[0], time.monotonic())

    def _take_report(self, _can_id: int, data: bytearray, _timestamp: float) -> None:
        self._on_report(Report(*REPORT.unpack(data)))

    def _take_emergency(self, can_id: int, data: bytearray, _timestamp: float) -> None:
        self._on_emergency(Emergency(can_id - EMERGENCY, *_EMERGENCY.unpack(data)))

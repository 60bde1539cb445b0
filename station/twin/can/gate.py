"""The reject gate: a CiA 401 node that opens a flap at an encoder count, and is safe without the station."""

from collections import deque
from typing import NamedTuple

from canopen.pdo.base import PdoMap
from canopen.sdo.exceptions import SdoAbortedError

from station.settings.can import GATE_EDS, CanSettings
from station.twin.can.faults import LineFault
from station.twin.can.network import LoopNetwork
from station.twin.can.node import TwinNode
from station.twin.clock import Clock
from station.twin.faults import CommonFault, FaultBoard

_RANGE = 2**32
_PLACES = 8
_LANES = 8
_KEPT = 256
_LATEST_S = 60.0
_ARMED, _FIRED, _LATE, _FULL, _BAD = range(5)
_COMMUNICATION, _CURRENT = 0x10, 0x02
_HEARTBEAT_LOST, _COUNT_LOST, _OVERLOAD, _WRONG_LENGTH = 0x8130, 0x8250, 0x2310, 0x8210
_CANNOT_BE_MAPPED = 0x06040041
_GENERAL = 0x08000000


class Shot(NamedTuple):
    """A reject actuation as the gate got or fired it."""

    sequence: int
    lane: int
    pulse_ms: int
    at_count: int


class RejectGate(TwinNode):
    """Eight flaps, eight places for orders."""

    def __init__(self, settings: CanSettings, clock: Clock, faults: FaultBoard) -> None:
        """Make the gate with the line's board."""
        network = LoopNetwork(settings, lambda: faults.gone(clock.now_s(), LineFault.GATE_SILENT))
        super().__init__(network, settings.gate_node, GATE_EDS)
        self._clock, self._faults = clock, faults
        self._armed: dict[int, Shot] = {}
        self._open_until_s: dict[int, float] = {}
        self._reports: deque[tuple[float, int, int, int]] = deque()
        self._count: int | None = None
        self._counted_s = 0.0
        self._station_s: float | None = None
        self.fired: deque[Shot] = deque(maxlen=_KEPT)
        """What was fired, oldest first; the count is the one at which the flap opened."""
        self.local.rpdo[1].add_callback(self._on_order)
        self.local.rpdo[2].add_callback(self._on_count)
        self.local.add_read_callback(self._read)
        self.local.add_write_callback(self._write)

    @property
    def output(self) -> int:
        """The flaps that are open, a bit for each lane: the safe ones unless operational."""
        if not self.operational:
            # CiA 401: 6206 selects the outputs that take the error value, 6207 is that value.
            return self.read(0x6206, 1) & self.read(0x6207, 1)
        now_s = self._clock.now_s()
        return sum(1 << (lane - 1) for lane, until_s in self._open_until_s.items() if until_s > now_s)

    def tick(self) -> None:
        """Send reports that are due, and check for what is missing: the station, and the encoder."""
        now_s = self._clock.now_s()
        while self._reports and self._reports[0][0] <= now_s:
            self._send_report(*self._reports.popleft()[1:])
        # CiA 301: object 1016 has the time in its lower 16 bits, in ms, and the node above them.
        limit_s = (self.read(0x1016, 1) & 0xFFFF) / 1000
        if limit_s and self._station_s is not None and now_s - self._station_s > limit_s:
            self._station_s = None  # watched again from its next beat on (CiA 301, heartbeat consumer)
            self.raise_error(_HEARTBEAT_LOST, _COMMUNICATION)
            if self.operational:
                # CiA 301: 1029 selects the state after a communication error; 1 means no change.
                state = {0: "PRE-OPERATIONAL", 2: "STOPPED"}.get(self.read(0x1029, 1))
                if state is not None:
                    self.local.nmt.state = state
                    self.on_state()
        # An RPDO's event timer, in ms, is the longest silence of its sender: here of the encoder.
        limit_s = self.read(0x1401, 5) / 1000
        if self.operational and limit_s and now_s - self._counted_s > limit_s:
            self.raise_error(_COUNT_LOST, _COMMUNICATION)
        if self._faults.active(LineFault.OVERLOAD):
            self.raise_error(_OVERLOAD, _CURRENT)
        else:
            self.clear_error(_OVERLOAD)

    def on_state(self) -> None:
        """Enter or leave operational: orders never outlive it."""
        super().on_state()
        self._armed.clear()
        self._open_until_s.clear()
        self._reports.clear()
        # Counts are ignored outside operational: none is valid now, and the encoder's silence is timed from here.
        self._count = None
        self._counted_s = self._clock.now_s()
        if self.operational:
            # Not by the next heartbeat: a gate that left operational works again only once the station has started it.
            self.clear_error(_HEARTBEAT_LOST)

    def _on_station(self, _can_id: int, _data: bytearray, _timestamp: float) -> None:
        self._station_s = self._clock.now_s()
        if self.operational:  # by object 1029 it was not left
            self.clear_error(_HEARTBEAT_LOST)

    def _on_count(self, pdo: PdoMap) -> None:
        # A frame shorter than its mapping would be read as a wrong count.
        if not self.operational or len(pdo.data) * 8 < pdo.length:
            return
        self._count = count = int(pdo["Line encoder count"].raw)
        self._counted_s = self._clock.now_s()
        self.clear_error(_COUNT_LOST)
        late = int(self._faults.amount(LineFault.MISPLACED))
        for shot in list(self._armed.values()):
            if _ahead(count, shot.at_count) + late <= 0:
                del self._armed[shot.sequence]
                self._open_until_s[shot.lane] = self._counted_s + shot.pulse_ms / 1000
                self.fired.append(shot._replace(at_count=count))
                self._report(shot.sequence, _FIRED)

    def _on_order(self, pdo: PdoMap) -> None:
        if not self.operational:
            return
        if len(pdo.data) * 8 != pdo.length:
            self.raise_error(_WRONG_LENGTH, _COMMUNICATION)
            return
        names = ("Sequence", "Lane", "Pulse in ms", "Fire at count")
        shot = Shot(*(int(pdo[f"Shot order.{name}"].raw) for name in names))
        if shot.sequence in self._armed:
            # An armed order that is repeated is confirmed again and stays one actuation.
            answer = _ARMED
        elif not 1 <= shot.lane <= _LANES or not shot.pulse_ms:
            answer = _BAD
        elif self._count is None or _ahead(self._count, shot.at_count) <= 0:
            # Without a count the gate cannot time the flap: refused, as if the place were past.
            answer = _LATE
        elif len(self._armed) >= _PLACES:
            answer = _FULL
        else:
            self._armed[shot.sequence] = shot
            answer = _ARMED
        self._report(shot.sequence, answer)

    def _report(self, sequence: int, answer: int) -> None:
        if self._faults.active(LineFault.NO_ECHO):
            return
        wrong = 1 if self._faults.active(CommonFault.WRONG) else 0
        late_s = min(_LATEST_S, self._faults.amount(CommonFault.DELAYED))
        report = ((sequence + wrong) % 65536, answer, self._count or 0)
        if late_s:
            self._reports.append((self._clock.now_s() + late_s, *report))
        else:
            self._send_report(*report)

    def _send_report(self, sequence: int, answer: int, count: int) -> None:
        pdo = self.local.tpdo[1]
        for name, value in (("Sequence", sequence), ("Fired", answer), ("Encoder count", count)):
            pdo[f"Shot report.{name}"].raw = value
        pdo.transmit()

    def _read(self, *, index: int, subindex: int, **_: object) -> int | None:
        if index == 0x6200 and subindex == 1:
            return self.output
        if (index, subindex) == (0x1018, 2) and self._faults.active(LineFault.WRONG_IDENTITY):
            return 0x0BAD_0BAD
        if (index, subindex) == (0x1600, 4) and self._faults.active(LineFault.MAPPING_CHANGED):
            return 0x2000_0210
        return None

    def _write(self, *, index: int, subindex: int, data: bytes, **_: object) -> None:
        # CiA 301: 1600 to 17FF map what is received, 1A00 to 1BFF what is sent.
        if (0x1600 <= index <= 0x17FF or 0x1A00 <= index <= 0x1BFF) and self._faults.active(LineFault.MAPPING_REFUSED):
            raise SdoAbortedError(_CANNOT_BE_MAPPED if subindex else _GENERAL)
        if (index, subindex) == (0x1016, 1):
            # CiA 301: the consumer watches the new node from its first heartbeat on.
            self._station_s = None
            self.network.subscribe(0x700 + (int.from_bytes(data, "little") >> 16 & 0x7F), self._on_station)


def _ahead(of: int, count: int) -> int:
    # Signed, the shorter way round the counter: a wrap of its 32 bits is no jump.
    return (count - of + _RANGE // 2) % _RANGE - _RANGE // 2

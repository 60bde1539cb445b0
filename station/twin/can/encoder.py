"""The line encoder: a CiA 406 node whose count follows the belt."""

from station.settings.can import ENCODER_EDS, CanSettings
from station.twin.can.faults import LineFault
from station.twin.can.network import LoopNetwork
from station.twin.can.node import TwinNode
from station.twin.clock import Clock
from station.twin.faults import CommonFault, FaultBoard

COUNTS_PER_S = 3000.0
"""A belt at 300 mm/s with 10 counts a millimetre."""
_RANGE = 2**32


class LineEncoder(TwinNode):
    """Counts through 32 bits and sends its count each time its event timer is over."""

    def __init__(self, settings: CanSettings, clock: Clock, faults: FaultBoard, first_count: int = 0) -> None:
        """Make the encoder with the line's board; it counts from `first_count`."""
        network = LoopNetwork(settings, lambda: faults.gone(clock.now_s(), LineFault.ENCODER_SILENT))
        super().__init__(network, settings.encoder_node, ENCODER_EDS)
        self._clock, self._faults = clock, faults
        self._way = float(first_count)
        self._moved_s = clock.now_s()
        self._due_s = 0.0
        self.local.add_read_callback(self._position)

    @property
    def count(self) -> int:
        """Position of the belt in counts, 0 to 2**32 - 1."""
        return int(self._way) % _RANGE

    def tick(self) -> None:
        """Move the belt, and send the count when it is time."""
        now_s = self._clock.now_s()
        passed_s, self._moved_s = now_s - self._moved_s, now_s
        if not self._faults.active(CommonFault.STUCK):
            speed = COUNTS_PER_S / (1 + self._faults.amount(CommonFault.SLOW))
            self._way = (self._way + passed_s * speed) % _RANGE
        if self.operational and now_s >= self._due_s:
            # After a pause the counts that were due meanwhile are not made up for.
            self._due_s = max(now_s, self._due_s + self.read(0x1800, 5) / 1000)
            position = self.local.tpdo[1]
            position["Position value"].raw = self.count
            position.transmit()

    def _position(self, *, index: int, **_: object) -> int | None:
        return self.count if index == 0x6004 else None

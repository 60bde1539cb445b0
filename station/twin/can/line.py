"""The line beside the cell: encoder and reject gate on one bus, for the demonstration and for tests."""

import asyncio
from contextlib import suppress
from typing import Any

from station.settings.can import CanSettings
from station.twin.can.encoder import LineEncoder
from station.twin.can.faults import LineFault
from station.twin.can.gate import RejectGate
from station.twin.clock import Clock
from station.twin.faults import CommonFault, FaultBoard

_TICK_S = 0.005
_GARBAGE_S = 0.05
_SHOWN = 8


class LineNodes:
    """Both nodes. The bus has to carry frames between them: they are two connections to it."""

    def __init__(self, settings: CanSettings, clock: Clock, faults: FaultBoard, first_count: int = 0) -> None:
        """Make the nodes with the switches from `line_faults`; nothing is opened before `start`."""
        self._settings, self._clock, self._faults = settings, clock, faults
        self.encoder = LineEncoder(settings, clock, faults, first_count)
        self.gate = RejectGate(settings, clock, faults)
        self._nodes = (self.encoder, self.gate)
        self._task: asyncio.Task[None] | None = None

    async def start(self) -> None:
        """Open the bus and boot both nodes.

        Raises:
            OSError: the bus cannot be had, or is a real one.
        """
        if self._settings.real_bus:
            raise OSError(f"CAN {self._settings.channel} is a real bus, where the twin has no business; take vcan0")
        try:
            for node in self._nodes:
                node.network.open()
                node.boot()
        except OSError:
            await self.stop()
            raise
        self._task = asyncio.create_task(self._run(), name="twin line")

    async def stop(self) -> None:
        """Close the bus. Idempotent."""
        if self._task:
            self._task.cancel()
            with suppress(asyncio.CancelledError):
                await self._task
            self._task = None
        for node in self._nodes:
            node.stop()
            node.network.close()

    def state(self) -> dict[str, Any]:
        """Count, open flaps and latest actuations, for the console."""
        return {
            "count": self.encoder.count,
            "gate": self.gate.local.nmt.state.lower(),
            "encoder": self.encoder.local.nmt.state.lower(),
            "output": self.gate.output,
            "fired": [shot._asdict() for shot in list(self.gate.fired)[-_SHOWN:]],
        }

    async def _run(self) -> None:
        garbage_s = 0.0
        while True:
            self.encoder.tick()
            self.gate.tick()
            if LineFault.BUS_OFF in self._faults.take_new():
                self.gate.network.report_bus_off()
            if self._faults.active(CommonFault.GARBAGE) and self._clock.now_s() > garbage_s:
                garbage_s = self._clock.now_s() + _GARBAGE_S
                # Emergency, TPDO 1, SDO answer and heartbeat; with one byte a heartbeat would be well-formed.
                for base in (0x080, 0x180, 0x580, 0x700):
                    self.gate.network.send_message(base + self.gate.number, b"\xff" if base != 0x700 else b"")
                self.encoder.network.send_message(0x180 + self.encoder.number, b"\xff")
            await asyncio.sleep(_TICK_S)

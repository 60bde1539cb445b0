"""What becomes of an outcome beside the registers: nothing, or a shot of the reject gate."""

import asyncio
import logging
from collections.abc import Mapping
from typing import Protocol

from plc_interface.can.errors import LineIoError
from plc_interface.can.line_io import LineIo
from station.channel.line import Outcome
from station.settings.can import CanSettings

REJECTS_LANE = 1

log = logging.getLogger(__name__)


class LineOutput(Protocol):
    """Where the interface hands outcomes on. Nothing here may wait or raise."""

    async def start(self) -> None:
        """Begin to reach the outputs."""
        ...

    async def stop(self) -> None:
        """Let the outputs go to their safe state."""
        ...

    def publish(self, outcome: Outcome) -> None:
        """Act on an outcome. The same one may come again after a restart."""
        ...

    def renew_health(self, lease_s: float) -> None:
        """The station is healthy for so many seconds more."""
        ...

    def acknowledge_faults(self) -> None:
        """Forget the faults whose cause is gone."""
        ...

    def encoder_count(self) -> int | None:
        """The line's encoder now; None where the PLC's is to be used."""
        ...

    @property
    def faults(self) -> tuple[str, ...]:
        """One sentence each."""
        ...

    @property
    def counters(self) -> Mapping[str, int]:
        """For the station's metrics, by names that the register map does not have."""
        ...


class NoOutput:
    """The line's PLC diverts."""

    faults: tuple[str, ...] = ()
    counters: Mapping[str, int] = {}

    async def start(self) -> None:
        """Nothing to reach."""

    async def stop(self) -> None:
        """Nothing to let go."""

    def publish(self, outcome: Outcome) -> None:
        """The PLC reads it.

        Args:
            outcome: unused.
        """

    def renew_health(self, lease_s: float) -> None:
        """Nobody waits for it.

        Args:
            lease_s: unused.
        """

    def acknowledge_faults(self) -> None:
        """There are none."""

    def encoder_count(self) -> int | None:
        """The PLC has its own."""
        return None


class RejectGate:
    """Everything that is not PASS is shot into the rejects' lane, at the count at which it reaches the gate."""

    def __init__(self, settings: CanSettings) -> None:
        self._io = LineIo(settings)
        self._shots: set[asyncio.Task[None]] = set()
        self.start = self._io.start
        self.renew_health = self._io.renew_health
        self.acknowledge_faults = self._io.acknowledge_faults

    async def stop(self) -> None:
        """Stop the heartbeat: the gate puts out its safe output. Shots ordered before stay the gate's."""
        for shot in self._shots:
            shot.cancel()
        await asyncio.gather(*self._shots, return_exceptions=True)
        await self._io.stop()

    def publish(self, outcome: Outcome) -> None:
        """Order a shot for what is not PASS.

        Args:
            outcome: with the encoder's count at its trigger.
        """
        if outcome.outcome != "PASS":
            shot = asyncio.create_task(self._divert(outcome), name=f"shot {outcome.sequence}")
            self._shots.add(shot)
            shot.add_done_callback(self._shots.discard)

    async def _divert(self, outcome: Outcome) -> None:
        try:
            await self._io.divert(outcome.sequence, REJECTS_LANE, self._io.count_at_gate(outcome.encoder))
        except LineIoError as error:
            log.warning("inspection %d was not diverted by CAN: %s", outcome.sequence, error)

    def encoder_count(self) -> int | None:
        """The count that the encoder on the bus said last."""
        count = self._io.encoder_count()
        return None if count is None else count.value

    @property
    def faults(self) -> tuple[str, ...]:
        """Of the bus, its nodes and recent shots."""
        return self._io.faults

    @property
    def counters(self) -> Mapping[str, int]:
        """Of the bus."""
        return {f"can_{name}": count for name, count in self._io.counters.items()}


def make_output(settings: CanSettings) -> LineOutput:
    """The outputs that the settings name."""
    return RejectGate(settings) if settings.enabled else NoOutput()

"""PLC interface: the handshake joined to its registers, its journal, the station and the line's outputs."""

import asyncio
import ipaddress
import logging
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from plc_interface.handshake import actions as do
from plc_interface.handshake import events as ev
from plc_interface.handshake.machine import next_due_s, step
from plc_interface.handshake.modes import Link
from plc_interface.handshake.state import restarted
from plc_interface.handshake.view import line, view
from plc_interface.outputs.line_output import LineOutput
from plc_interface.process.journal_file import JournalFile
from plc_interface.process.station_link import StationLink, now
from plc_interface.registers.map import BY_NAME
from plc_interface.registers.register import Value
from plc_interface.registers.values import formatted_registers
from plc_interface.server.image import RegisterImage
from plc_interface.server.peer import Peer
from plc_interface.server.statistics import Statistics
from plc_interface.server.write_lock import WriterChange
from station.channel.line import Line, LineFault
from station.settings.plc import HandshakeSettings

_CONTROL = BY_NAME["control"]
_NEVER = object()

log = logging.getLogger(__name__)


class Interface:
    """Feeds events to the handshake and carries out its actions. Belongs to one event loop; nothing in it waits."""

    def __init__(
        self, settings: HandshakeSettings, endpoint: str, image: RegisterImage, journal: JournalFile, output: LineOutput
    ) -> None:
        """Continue from the journal of the run before; the output receives every outcome."""
        self._settings, self._image, self._journal, self._output = settings, image, journal, output
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None
        self._station = StationLink(endpoint, settings, self.feed, self._line)
        self._inputs = ev.Inputs(lot=None)  # none was written: the one in force is the journal's
        self._state = restarted(journal.read(), now(), settings.station_lost_after_s)
        self._statistics = Statistics()
        self._before_reset = (0, 0)
        self._written: dict[str, Value] = {}
        self._writer: Peer | None = None
        # A trigger that was pending is refused from here on, which has to outlive a loss of power.
        journal.write(self._state.journal, durable=True)
        self._publish()

    def start(self, statistics: Statistics) -> None:
        """Start the requests to the station."""
        self._statistics = statistics
        self._wake_when_due()
        self._station.start()

    async def stop(self) -> None:
        """End every request and timer. Idempotent."""
        if self._timer is not None:
            self._timer.cancel()
        await self._station.stop()

    def leave(self) -> None:
        """Report to the PLC that the station is offline; nothing is started any more."""
        self.feed(ev.ShuttingDown(now()))

    def on_write(self, _writer: Peer, values: Mapping[str, Value]) -> None:
        """Handle a write; the answer is in the registers before the request is answered."""
        known: dict[str, Any] = {name: value for name, value in values.items() if name != "write_key"}
        if "control" in known:
            known["control"] = _CONTROL.names(known["control"])
        self._inputs = replace(self._inputs, **known)
        # Before the write: a trigger in it is accepted only if its fruit can be diverted now.
        self._report_output()
        count = self._output.encoder_count()  # after that, as the output is ready by its first count
        inputs = self._inputs if count is None else replace(self._inputs, encoder=count)
        self.feed(ev.PlcWrote(now(), inputs, frozenset(known)))

    def on_writer(self, peer: Peer | None, change: WriterChange) -> None:
        """Handle a change of the right to write."""
        self._writer = peer
        # A takeover withdraws first, so that the new connection has to arm anew.
        if peer is None or change is WriterChange.TAKEN_OVER:
            self.feed(ev.WriterWithdrawn(now()))
        if peer is not None:
            self.feed(ev.WriterGranted(now()))
        self._image.commit({"writer_ipv4": _ipv4(peer)})

    def feed(self, event: ev.Event) -> None:
        """Run one step: outputs, then the journal, then the registers in one slice, then everything else."""
        epoch = self._state.journal.epoch
        self._state, actions = step(self._state, event, self._settings)
        if self._state.journal.epoch != epoch:
            self._before_reset = (self._statistics.bad_requests, self._statistics.refused_connections)
        # An outcome that the journal has is not forwarded again after a restart. So the output gets it first: a kill in
        # between has it forwarded twice, which the output ignores; in the other order the reject would be lost.
        for action in actions:
            if isinstance(action, do.ForwardOutcome):
                self._output.publish(action.outcome)
        for action in actions:
            if isinstance(action, do.SaveJournal):
                self._journal.write(action.journal, durable=action.durable)
        self._publish()
        for action in actions:
            self._carry_out(action)
        if isinstance(event, ev.Beat):
            if self._state.link is Link.UP and event.station.healthy:
                self._output.renew_health(self._settings.station_lost_after_s)
            self._report_output()
        self._wake_when_due()

    def _report_output(self) -> None:
        if self._output.ready != self._state.diverts:
            self.feed(ev.OutputChanged(now(), self._output.ready))

    def _publish(self) -> None:
        values = view(self._state) | self._server_counts()
        changed = {name: value for name, value in values.items() if self._written.get(name, _NEVER) != value}
        self._image.commit(changed)
        self._written = values

    def _carry_out(self, action: do.Action) -> None:
        match action:
            case do.Log(text=text, warning=warning):
                log.log(logging.WARNING if warning else logging.INFO, "%s", text)
            case do.ClearFaults():
                self._output.acknowledge_faults()
            case do.RequestCommand(command=command, argument=argument):
                log.info("%s orders %s, argument %d", self._writer, command.value, argument)
                self._station.carry_out(action)
            case _:
                self._station.carry_out(action)

    def _server_counts(self) -> dict[str, int]:
        bad, refused = self._before_reset
        return {
            "count_bad_requests": (self._statistics.bad_requests - bad) % 2**32,
            "count_refused_connections": (self._statistics.refused_connections - refused) % 2**32,
        }

    def _line(self) -> Line:
        trouble = self._journal.trouble
        faults = (*(() if trouble is None else (LineFault(part="journal", what=trouble),)), *self._output.faults)
        counters = {**self._server_counts(), **self._output.counters}
        state, station = line(self._state, counters, faults), self._state.station
        if station is None or not station.registers_wanted:
            return state
        return state.model_copy(update={"registers": formatted_registers(self._image.value)})

    def _wake_when_due(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
        due_s = next_due_s(self._state)
        self._timer = None if due_s is None else self._loop.call_at(due_s, lambda: self.feed(ev.Tick(now())))


def _ipv4(peer: Peer | None) -> int:
    """Return the address as the register writer_ipv4 has it; 0 for none and for IPv6."""
    if peer is None:
        return 0
    address = ipaddress.ip_address(peer.address)
    return int(address) if address.version == 4 else 0

"""A scripted station behind its channel, and waiting for what it does."""

import asyncio
import functools
from typing import Any

from station.channel.line import (
    Acknowledged,
    AwaitOutcome,
    Begin,
    BeginReply,
    Command,
    CommandDone,
    Line,
    Noted,
    Open,
    Outcome,
    PackmlState,
    Published,
    Reason,
    Refusal,
    Resume,
    StationState,
)
from station.channel.server import ChannelServer, Handlers
from station.errors import BadInputError
from tests import eventually

PATIENCE_S = 30.0


until = functools.partial(eventually.until, patience_s=PATIENCE_S)


class ScriptedStation:
    """Answers the channel as a station does. Its records outlive its process; a test sets how it judges."""

    def __init__(self, endpoint: str) -> None:
        self.endpoint = endpoint
        self.boots = 0
        self.accepted: dict[int, Begin] = {}
        self.outcomes: dict[int, Outcome] = {}
        self.published: dict[int, Outcome] = {}
        self.acknowledged = 0
        self.running: int | None = None
        self.lines: list[Line] = []
        self.commands: list[Command] = []
        self.healthy = True
        self.packml_state = PackmlState.EXECUTE
        self.refusal: Refusal | None = None
        self.deadline_s = 60.0
        self.command_gate = asyncio.Event()
        self.command_gate.set()
        self.command_done = CommandDone(done=True, why=None)
        self.stopped = False
        """Stopped with its jaws closed: not ready, whatever runs."""
        self.report_gate = asyncio.Event()
        """While it is clear, a report of the state is held back after it was made."""
        self.report_gate.set()
        self.deaf = False
        self.lost_waits = 0
        """So many requests for an outcome to come get no answer, as if it had been lost on its way."""
        self.spoilt_notes = 0
        """So many notes to come are refused, as if they had been spoilt on their way."""
        self._task: asyncio.Task[None] | None = None

    async def start(self) -> None:
        self.boots += 1
        if self.running is not None:
            self.finish("NO_RESULT", Reason.STATION_LOST)
        handlers: Handlers = {
            Begin: self._begin,
            AwaitOutcome: self._await,
            Published: self._published,
            Acknowledged: self._acknowledged,
            Resume: self._resume,
            Line: self._line,
            Command: self._command,
        }
        server = ChannelServer(self.endpoint, handlers)
        self._task = asyncio.create_task(server.serve(), name="scripted station")

    async def die(self) -> None:
        """As if killed: nothing is answered any more."""
        if self._task:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
            self._task = None

    def finish(self, name: str = "PASS", *reasons: Reason, **changes: Any) -> Outcome:
        """End the running inspection."""
        assert self.running is not None
        sequence, self.running = self.running, None
        begin = self.accepted[sequence]
        measured = name != "NO_RESULT"
        values: dict[str, Any] = {
            "sequence": sequence,
            "trigger_id": begin.trigger_id,
            "outcome": name,
            "reasons": reasons,
            "late": False,
            "partial": not measured,
            "simulated": True,
            "area_mm2": 12.34 if measured else None,
            "area_px": 567 if measured else None,
            "closing_mm": 1.5 if measured else None,
            "confidence": 0.9 if measured else None,
            "recipe_number": 3,
            "recipe_checksum": 0x12345678,
            "began_utc_ms": 1_700_000_000_000,
            "ended_utc_ms": 1_700_000_000_900,
            "duration_ms": 900,
            "encoder": begin.encoder,
            "lot": begin.lot,
            "fruit_length_mm_x10": begin.fruit_length_mm_x10,
            "size_class": begin.size_class,
        }
        self.outcomes[sequence] = Outcome.model_validate(values | changes)
        return self.outcomes[sequence]

    async def _begin(self, request: Begin) -> BeginReply:
        await until(lambda: not self.deaf)
        if self.refusal or self.running:
            return BeginReply(refusal=self.refusal or Refusal.BUSY)
        sequence = max(self.accepted, default=100) + 1
        self.accepted[sequence] = request
        self.running = sequence
        return BeginReply(sequence=sequence, deadline_s=self.deadline_s)

    async def _await(self, request: AwaitOutcome) -> Outcome:
        if self.lost_waits:
            self.lost_waits -= 1
            await asyncio.Event().wait()
        return await until(lambda: self.outcomes.get(request.sequence))

    def _spoil(self) -> None:
        if self.spoilt_notes:
            self.spoilt_notes -= 1
            raise BadInputError("the note is malformed")

    async def _published(self, request: Published) -> Noted:
        self._spoil()
        self.published[request.outcome.sequence] = request.outcome
        if self.running == request.outcome.sequence:
            self.running = None
        return Noted()

    async def _acknowledged(self, request: Acknowledged) -> Noted:
        self._spoil()
        self.acknowledged = max(self.acknowledged, request.sequence)
        return Noted()

    async def _resume(self, _request: Resume) -> Open:
        standing = self.outcomes | self.published
        running = (self.running, self.accepted[self.running].trigger_id) if self.running else None
        ended = tuple(standing[sequence] for sequence in sorted(standing) if sequence > self.acknowledged)
        return Open(running=running, outcomes=ended)

    async def _line(self, request: Line) -> StationState:
        self.lines.append(request)
        state = StationState(
            boot=f"boot {self.boots}",
            healthy=self.healthy,
            ready=self.running is None and not self.stopped,
            why_not_ready=None,
            packml_state=PackmlState.ABORTED if self.stopped else self.packml_state,
            mode=1,
            recipe_number=3,
            recipe_checksum=0x12345678,
            error_code=0,
            alarms=1 << 63 | 1 << 32 | 0b101,
            simulated=True,
        )
        await self.report_gate.wait()
        return state

    async def _command(self, request: Command) -> CommandDone:
        self.commands.append(request)
        await self.command_gate.wait()
        return self.command_done

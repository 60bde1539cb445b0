"""The real server and the real handshake on a port, with a station behind them that a test makes up."""

import asyncio
import re
import time
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from typing import Any

import pytest

from plc_interface.handshake import actions, events
from plc_interface.handshake.events import Inputs, Moment
from plc_interface.handshake.journal import Journal
from plc_interface.handshake.machine import step
from plc_interface.handshake.state import restarted
from plc_interface.handshake.view import view
from plc_interface.registers.codec import WordOrder
from plc_interface.registers.generate.scl import s7_1500
from plc_interface.registers.generate.structured_text import function_block
from plc_interface.registers.map import BY_NAME, REGISTERS
from plc_interface.server.image import RegisterImage
from plc_interface.server.peer import Peer
from plc_interface.server.server import ModbusServer
from plc_interface.server.write_lock import WriterChange
from station.channel.line import BeginReply, Open, Outcome, PackmlState, Reason, Refusal, StationState
from station.settings.modbus import ModbusSettings
from station.settings.plc import HandshakeSettings
from tests.ports import free_port
from tests.tools import required

BEAT_S = 0.05


def now() -> Moment:
    return Moment(time.monotonic(), time.time_ns() // 1_000_000)


class Rig:
    """Station that a test makes up, and the PLC interface in front of it."""

    def __init__(self, port: int, order: WordOrder) -> None:
        self.port = port
        self.inspection_s = 0.05
        self.first_sequence = 0x00010001
        self.answers = True
        """The station answers beats."""
        self.packml_state = PackmlState.EXECUTE
        self.alarms: set[int] = set()
        """Numbers of the active ones."""
        self.refusal: Refusal | None = None
        self.outcome: dict[str, Any] = {}
        self.command_fails = ""
        self.commands: list[tuple[str, int]] = []
        self.accepted: list[tuple[int, int, str]] = []
        """Trigger id, encoder and lot of every accepted trigger."""
        self.sizes: list[tuple[int, int]] = []
        """Length and class of every inspection."""
        self.image = RegisterImage(order)
        self.settings = HandshakeSettings()
        self.state = restarted(Journal(), now(), self.settings.station_lost_after_s)
        self.server = ModbusServer(
            ModbusSettings(port=port, word_order=order.value), self.image, self._wrote, self._writer
        )
        self._later: set[asyncio.TimerHandle] = set()

    def soon(self, delay_s: float, make: Callable[[], events.Event]) -> None:
        loop = asyncio.get_running_loop()
        handle = loop.call_later(delay_s, lambda: (self._later.discard(handle), self.handle(make())))
        self._later.add(handle)

    def handle(self, event: events.Event) -> None:
        self.state, todo = step(self.state, event, self.settings)
        self.image.commit(view(self.state))
        for action in todo:
            self._act(action)

    def beat(self) -> None:
        self.handle(
            events.Beat(
                now(),
                StationState(
                    boot="one", healthy=True, ready=True, why_not_ready=None, packml_state=self.packml_state, mode=1,
                    recipe_number=3, recipe_checksum=0xCAFE, error_code=0, simulated=True,
                    alarms=sum(1 << number - 1 for number in self.alarms),
                ),
                now().s,
            )
        )  # fmt: skip

    def stop(self) -> None:
        for handle in self._later:
            handle.cancel()

    def _wrote(self, _peer: Peer, values: Mapping[str, Any]) -> None:
        written = {name: values.get(name, self.image.value(name)) for name in CONTROL_NAMES}
        control = BY_NAME["control"].names(int(written.pop("control") or 0))
        written.pop("write_key")
        self.handle(events.PlcWrote(now(), Inputs(control=control, **written), frozenset(values)))

    def _writer(self, peer: Peer | None, _change: WriterChange) -> None:
        self.handle(events.WriterGranted(now()) if peer else events.WriterWithdrawn(now()))

    def _act(self, action: actions.Action) -> None:
        match action:
            case actions.RequestBegin():
                reply = BeginReply(refusal=self.refusal)
                if self.refusal is None:
                    self.accepted.append((action.trigger_id, action.encoder, action.lot))
                    self.sizes.append((action.fruit_length_mm_x10, action.size_class))
                    reply = BeginReply(sequence=self.first_sequence + len(self.accepted) - 1, deadline_s=5.0)
                self.soon(0.01, lambda: events.BeginAnswered(now(), action.number, reply))
            case actions.RequestOutcome():
                self.soon(self.inspection_s, lambda: events.OutcomeReceived(now(), self._made(action.sequence)))
            case actions.RequestOpen():
                self.soon(0, lambda: events.OpenAnswered(now(), action.number, Open(running=None, outcomes=())))
            case actions.RequestCommand():
                self.commands.append((action.command.value, action.argument))
                done, why = not self.command_fails, self.command_fails
                self.soon(0.02, lambda: events.CommandAnswered(now(), action.number, done, why))
            case actions.NotifyPublished():
                self.soon(0, lambda: events.OutcomeNoted(now(), action.outcome.sequence))
            case _:
                pass

    def _made(self, sequence: int) -> Outcome:
        trigger_id, encoder, lot = self.accepted[sequence - self.first_sequence]
        length, size_class = self.sizes[sequence - self.first_sequence]
        made: dict[str, Any] = {
            "sequence": sequence, "trigger_id": trigger_id, "outcome": "PASS", "reasons": (), "late": False,
            "partial": False, "simulated": True, "area_mm2": 12.34, "area_px": 70_001, "closing_mm": 0.75,
            "confidence": 0.87, "recipe_number": 3, "recipe_checksum": 0xCAFE, "began_utc_ms": 1, "ended_utc_ms": 2**40,
            "duration_ms": 100_000, "encoder": encoder, "lot": lot,
            "fruit_length_mm_x10": length, "size_class": size_class,
        }  # fmt: skip
        return Outcome(**{**made, **self.outcome})


CONTROL_NAMES = [register.name for register in BY_NAME.values() if register.access.value == "read and write"]


async def _beating(rig: Rig) -> None:
    while True:
        if rig.answers:
            rig.beat()
        rig.handle(events.Tick(now()))
        await asyncio.sleep(BEAT_S)


@asynccontextmanager
async def serving(order: WordOrder = WordOrder.HIGH_FIRST) -> AsyncIterator[Rig]:
    rig = Rig(free_port(), order)
    await rig.server.start()
    beating = asyncio.create_task(_beating(rig))
    try:
        yield rig
    finally:
        beating.cancel()
        await asyncio.gather(beating, return_exceptions=True)
        await rig.server.stop()
        rig.stop()


@pytest.fixture
def serve() -> Callable[..., AbstractAsyncContextManager[Rig]]:
    return serving


@pytest.fixture
def mbpoll() -> str:
    """The path of the Modbus client."""
    return required("mbpoll")


@pytest.fixture
def vocabulary() -> set[str]:
    """Every name that a document may put into code."""
    words = {*WordOrder, *re.findall(r"\w+", function_block() + s7_1500())}
    words |= {field for settings in (ModbusSettings, HandshakeSettings) for field in settings.model_fields}
    for register in REGISTERS:
        words |= {register.name, *(bit.name for bit in register.bits), *(code.name for code in register.codes.values())}
    return words


@pytest.fixture
def no_contact() -> dict[str, Any]:
    """Return the changes of an outcome where nothing was touched."""
    return {
        "outcome": "NO_RESULT", "reasons": (Reason.NO_CONTACT, Reason.LOW_CONFIDENCE), "area_mm2": None,
        "area_px": None, "closing_mm": None, "confidence": None, "partial": True,
    }  # fmt: skip

"""A reject over a kill of the interface at each write to the disk."""

import asyncio
import contextlib

import pytest

from plc_interface.handshake import events as ev
from plc_interface.handshake.journal import Journal, Running
from plc_interface.outputs.line_output import RejectGate
from plc_interface.process.interface import Interface
from plc_interface.process.journal_file import JournalFile
from plc_interface.process.station_link import now
from plc_interface.registers.codec import WordOrder
from plc_interface.server.image import RegisterImage
from plc_interface.server.statistics import Statistics
from station.atomic_file import write_atomically
from station.channel.line import Begin, Reason
from station.settings.can import CanSettings
from station.settings.plc import HandshakeSettings
from tests.plc_interface.scripted_station import ScriptedStation, until

SEQUENCE, ENCODER = 41, 5000
CAN = CanSettings(enabled=True, interface="virtual", channel="reject kill")
WRITERS = {
    "journal.json": "plc_interface.process.journal_file.write_atomically",
    "shots.json": "plc_interface.outputs.pending_rejects_file.write_atomically",
}


class Killed(BaseException):
    """As by SIGKILL: nothing handles it."""


@contextlib.asynccontextmanager
async def run_of_interface(folder, endpoint):
    """One run, not started; its end writes no file."""
    journal, gate = JournalFile(folder), RejectGate(CAN, folder)
    interface = Interface(HandshakeSettings(), endpoint, RegisterImage(WordOrder.HIGH_FIRST), journal, gate)
    try:
        yield interface, gate
    finally:
        await interface.stop()
        await gate.stop()
        journal.close()


@pytest.fixture
def station(short_folder):
    """With a FAIL that ended the inspection."""
    made = ScriptedStation(f"ipc://{short_folder}/line.ipc")
    made.accepted[SEQUENCE] = Begin(trigger_id=7, encoder=ENCODER, lot="")
    made.running = SEQUENCE
    made.finish("FAIL", Reason.AREA_OVER_LIMIT)
    return made


@pytest.mark.parametrize("replaced", [False, True], ids=["before the file is replaced", "after"])
@pytest.mark.parametrize("last", WRITERS)
def test_a_reject_outlives_a_kill_at_each_write(monkeypatch, tmp_path, station, last, replaced):
    outcome = station.outcomes[SEQUENCE]
    running = Running(
        **outcome.model_dump(include=set(Running.model_fields)), within_s=60.0, began_s=now().s
    ).model_copy(update={"began_utc_ms": now().utc_ms})

    def kill(path, data, **how):
        if replaced:
            write_atomically(path, data, **how)
        raise Killed

    async def killed():
        file = JournalFile(tmp_path)
        file.write(Journal(running=running, highest=SEQUENCE, acknowledged=SEQUENCE - 1), durable=True)
        file.close()
        async with run_of_interface(tmp_path, station.endpoint) as (interface, _):
            with monkeypatch.context() as patched:
                patched.setattr(WRITERS[last], kill)
                with pytest.raises(Killed):
                    interface.feed(ev.OutcomeReceived(now(), outcome))

    async def run_after():
        await station.start()
        try:
            async with run_of_interface(tmp_path, station.endpoint) as (interface, gate):
                interface.start(Statistics())
                await gate.start()
                await until(lambda: SEQUENCE in station.published)
                assert gate._due == {SEQUENCE: ENCODER + CAN.distance_counts}
                orders = [order.get_name() for order in gate._rejects.values()]
                assert orders == [f"reject {SEQUENCE}"], "one order, however it came"
        finally:
            await station.die()

    asyncio.run(killed())
    asyncio.run(run_after())

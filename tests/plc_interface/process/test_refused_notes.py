"""Notes that the station refuses for a while, as its records cannot be written."""

import asyncio
import tempfile

import pytest

from plc_interface.handshake import actions as do
from plc_interface.handshake import events as ev
from plc_interface.process import station_link
from plc_interface.process.station_link import StationLink
from station.channel.line import Begin, Noted, Published, Reason
from station.messages import records as messages
from station.records.errors import UnknownInspectionError
from station.settings.plc import HandshakeSettings
from tests.plc_interface.scripted_station import ScriptedStation, until


@pytest.mark.parametrize("refusals", [3, 8])
def test_a_note_that_is_refused_is_repeated_until_the_station_takes_it(refusals, monkeypatch):
    """Else the station's record would have another outcome than the PLC, until the next resynchronisation."""
    monkeypatch.setattr(station_link, "_NOTE_AGAIN_S", 0.01)
    monkeypatch.setattr(station_link, "_NOTE_LATER_S", 0.01)
    events: list[ev.Event] = []

    async def main(home: str):
        station = ScriptedStation(f"ipc://{home}/line.ipc")
        station.accepted[101], station.running = Begin(trigger_id=4711, encoder=0, lot=""), 101
        outcome = station.finish("NO_RESULT", Reason.LATE)
        station.spoilt_notes = refusals
        settings = HandshakeSettings(station_lost_after_s=30.0)
        link = StationLink(station.endpoint, settings, events.append, lambda: pytest.fail("no beat was started"))
        await station.start()
        link.carry_out(do.NotifyPublished(outcome))
        link.carry_out(do.NotifyAcknowledged(101))
        await until(lambda: station.published == {101: outcome} and station.acknowledged == 101)
        await until(lambda: not link._notes)
        assert station.spoilt_notes == 0
        noted = [event.sequence for event in events if isinstance(event, ev.OutcomeNoted)]
        assert noted == [101]
        assert len(events) == 1, "no resynchronisation"
        await link.stop()
        await station.die()

    with tempfile.TemporaryDirectory() as home:
        asyncio.run(main(home))


def test_a_note_on_an_inspection_that_the_station_never_began_is_not_repeated(monkeypatch):
    """An earlier home was put back: its number may soon be another fruit's."""
    monkeypatch.setattr(station_link, "_NOTE_AGAIN_S", 0.01)
    monkeypatch.setattr(station_link, "_NOTE_LATER_S", 0.01)
    sequences: list[int] = []

    async def refuse(request: Published) -> Noted:
        sequences.append(request.outcome.sequence)
        raise UnknownInspectionError(messages.NEVER_BEGUN(number=request.outcome.sequence), messages.ASK_OPEN())

    async def main(home: str):
        station = ScriptedStation(f"ipc://{home}/line.ipc")
        station.accepted[101], station.running = Begin(trigger_id=4711, encoder=0, lot=""), 101
        outcome = station.finish("NO_RESULT", Reason.LATE)
        monkeypatch.setattr(station, "_published", refuse)
        settings = HandshakeSettings(station_lost_after_s=30.0)
        link = StationLink(station.endpoint, settings, lambda _: None, lambda: pytest.fail("no beat was started"))
        await station.start()
        link.carry_out(do.NotifyPublished(outcome))
        await until(lambda: sequences and not link._notes)
        await until(lambda: link._repeating is not None and link._repeating.done())
        await link.stop()
        await station.die()

    with tempfile.TemporaryDirectory() as home:
        asyncio.run(main(home))
    assert sequences == [101] * 3

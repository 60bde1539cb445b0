"""The documents that are made from the domain's tables."""

import re
import xml.etree.ElementTree as ET
from pathlib import Path

from station.inspection.alarm_table import ALARMS, anchor
from station.inspection.cycle import TABLE, Event
from station.inspection.diagram import DISTURBED, PLACES, diagram
from station.inspection.export import alarms_document, cycle_document, exported
from station.inspection.states import State

ROOT = Path(__file__).resolve().parents[2]


def test_the_documents_are_what_the_tables_say():
    for path, text in exported(ROOT).items():
        assert path.read_text(encoding="utf-8") == text, f"{path.name}: run python -m station.inspection.export"


def test_the_drawing_shows_every_state_and_event_apart_from_the_disturbances():
    assert set(PLACES) == set(State)
    assert len(set(PLACES.values())) == len(PLACES)
    words = " ".join(element.text or "" for element in ET.fromstring(diagram()).iter())
    for state in State:
        assert state.value.replace("_", " ") in words
    drawn = {event for (state, event), t in TABLE.items() if t.state != state} - DISTURBED
    for event in drawn:
        assert event.value.replace("_", " ") in words, event


def test_every_state_event_and_alarm_is_in_its_document():
    text = cycle_document()
    for name in [*State, *Event]:
        assert f"`{name}`" in text
    headings = {line.removeprefix("## ").replace(" ", "-") for line in alarms_document().splitlines()}
    for alarm, row in ALARMS.items():
        assert anchor(alarm).partition("#")[2] in headings
        assert str(row.action) in alarms_document()
    links = set(re.findall(r"\(alarms\.md#([a-z-]+)\)", text))
    assert links
    assert links <= headings

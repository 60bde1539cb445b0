"""The laws behind disturbed links: each is broken on purpose, and found; the page counts it."""

from dataclasses import replace
from pathlib import Path

from benchmarks.reliability.link_laws import of_passage, of_records
from benchmarks.reliability.link_observer import Observer
from benchmarks.reliability.link_page import sections_of
from benchmarks.reliability.link_results import NONE_STALE, ONE_OUTCOME, WHOLE_PRESS, Fruit, Results, Story, read, write
from plc_interface.plc_simulator.program import Decision, Passage
from station.channel.line import Outcome
from station.records.model import CurvePoint, FullRecord, InspectionRecord, Trigger
from station.settings.modbus import ModbusSettings

DECIDING_MM = 3.0
JUDGED = InspectionRecord(
    "PASS", (), (), late=False, partial=False, area_mm2=38.0, area_px=1, closing_mm=3.0, confidence=0.9,
    ended_utc_ms=9, duration_ms=4, curve=(CurvePoint(1, 20.0, 3.0, 38.0, 1, 0.9),),
)  # fmt: skip
OUTCOME = Outcome(
    sequence=5, trigger_id=7, outcome="PASS", reasons=(), late=False, partial=False, simulated=True, area_mm2=38.0,
    area_px=1, closing_mm=3.0, confidence=0.9, recipe_number=1, recipe_checksum=1, began_utc_ms=1, ended_utc_ms=9,
    duration_ms=4, encoder=1, lot="",
)  # fmt: skip
RECORD = FullRecord(
    sequence=5, trigger=Trigger(7, 1, "", 1, None, simulated=True), boot="b", judged=JUDGED, standing=OUTCOME,
    published_utc_ms=9, acknowledged_utc_ms=10, images=(), images_state=None,
)  # fmt: skip
PASSAGE = Passage(
    number=1, trigger_id=7, decision=Decision.PASS, reasons=(), sequence=5, area_mm2=38.0, closing_mm=3.0,
    cycle_s=2.0, fruit_length_mm_x10=0, fault=None,
)  # fmt: skip


def broken_by(*records: FullRecord, shown: tuple[object, ...] = (7, "PASS", (), 38.0)) -> list[str]:
    """The laws that records break, beside what was shown of sequence 5."""
    observer = Observer(ModbusSettings(), lambda: True)
    observer.shown[5] = {shown}
    return [law for law, _ in of_records(records, observer, DECIDING_MM)]


def test_a_whole_inspection_breaks_nothing():
    assert broken_by(RECORD) == []
    assert list(of_passage(PASSAGE, [RECORD], bruised=False)) == []


def test_each_law_of_the_records_is_found():
    assert broken_by(replace(RECORD, acknowledged_utc_ms=None)) == [ONE_OUTCOME]
    assert broken_by(RECORD, replace(RECORD, sequence=6)) == [ONE_OUTCOME]
    withdrawn = replace(RECORD, sequence=4, standing=OUTCOME.model_copy(update={"outcome": "NO_RESULT"}))
    assert broken_by(withdrawn, RECORD) == []
    assert broken_by(replace(withdrawn, sequence=5), RECORD) == [ONE_OUTCOME, ONE_OUTCOME]
    assert broken_by(RECORD, shown=(7, "FAIL", (), 38.0)) == [ONE_OUTCOME]
    assert broken_by(RECORD, shown=(8, "PASS", (), 38.0)) == [NONE_STALE]
    short = replace(JUDGED, curve=(CurvePoint(1, 20.0, 1.0, 38.0, 1, 0.9),))
    assert broken_by(replace(RECORD, judged=short)) == [WHOLE_PRESS]


def test_each_law_of_a_decision_is_found():
    def laws(passage: Passage, *, bruised: bool = False) -> list[str]:
        return [law for law, _ in of_passage(passage, [RECORD], bruised=bruised)]

    assert laws(replace(PASSAGE, trigger_id=8)) == [NONE_STALE]
    assert laws(replace(PASSAGE, decision=Decision.FAIL)) == [ONE_OUTCOME]
    assert laws(PASSAGE, bruised=True) == [WHOLE_PRESS]
    assert laws(replace(PASSAGE, decision=Decision.NO_ANSWER, sequence=0), bruised=True) == []


def test_stories_are_kept_whole_and_the_page_counts_them(tmp_path: Path):
    cut = Fruit(
        seed=3, number=2, bruised=True, link="camera", kind="stall", touched=1, outcome="NO_RESULT",
        signs=("NO_RESULT",), detected_s=0.5, safe_s=0.3, ready_s=6.0, broken=((ONE_OUTCOME, "none came"),),
    )  # fmt: skip
    story = Story(seed=3, fruits=(Fruit(seed=3, number=1, bruised=False, outcome="PASS"), cut), triggers=2, ended=True)
    write(tmp_path / "kept.json", [story])
    made = read(tmp_path / "kept.json")
    assert made == Results(stories=(story,))
    sections = sections_of(made, tmp_path / "chart.svg")
    assert f"| {ONE_OUTCOME} | 1 |" in sections["laws"]
    assert "\nStory 3, fruit 2: none came" in sections["laws"]
    (camera,) = (line for line in sections["times"] if line.startswith("| camera"))
    assert camera.split(" | ")[1:3] == ["1", "1"]
    assert camera.count("0 of 1") == 2, "neither the 250 ms nor the 5 s were met"
    assert (tmp_path / "chart.svg").stat().st_size > 0

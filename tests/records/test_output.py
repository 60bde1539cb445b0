"""Outputs of the records: CSV, Parquet and a lot's report have the same content as the records."""

import contextlib
import csv
import json
import re
import subprocess
from dataclasses import replace

import pyarrow.parquet as pq
import pytest

from hmi.api.model import InspectionDetails, InspectionSummary
from station.channel.line import Reason
from station.messages import records as messages
from station.outbox.feed import read_batch
from station.records import export as exporting
from station.records.database import reading
from station.records.errors import DiskFullError
from station.records.export import COLUMNS, export
from station.records.lot_summary import summarise
from station.records.queries import read_summaries
from station.records.search import Query
from tests.chromium import ARGUMENTS
from tests.records.causes import because
from tests.stored_inspection import read_record


@pytest.fixture
def history(opened, scenario, trigger, passed, failed, noise, settled):
    """Seven fruit of two lots, and one that runs."""

    async def steps():
        async with opened() as records:
            for number in range(7):
                sequence = await records.begin(replace(trigger, lot="a <b> & 'c'" if number < 4 else "other"))
                record = replace(failed, images=(noise("step", 0, 200),)) if number % 2 else passed
                await records.published(await records.conclude(sequence, record))
            await settled(records)

    scenario(steps)


def test_csv_and_parquet_hold_the_same(history, run_records, tmp_path, monkeypatch):
    monkeypatch.setattr(exporting, "WINDOW", 3)  # the last window is not full
    assert run_records("export", tmp_path / "all.csv").output.endswith("7 inspections\n")
    assert run_records("export", tmp_path / "all.parquet").exit_code == 0
    with (tmp_path / "all.csv").open(newline="", encoding="utf-8") as file:
        text = list(csv.DictReader(file))
    typed = pq.read_table(tmp_path / "all.parquet").to_pylist()
    assert [row["sequence"] for row in typed] == list(range(1, 8))
    assert list(text[0]) == [column.name for column in COLUMNS]
    for row, cells in zip(typed, text, strict=True):
        assert row["began"].isoformat(timespec="milliseconds") == cells["began"]
        assert row["reasons"] == json.loads(cells["reasons"])
        assert row["areas_mm2"] == json.loads(cells["areas_mm2"]) == [0.0, 8.0, 16.0, 24.0, 32.0]
        assert (row["lot"], str(row["area_mm2"])) == (cells["lot"], cells["area_mm2"])
        assert len(row["images"]) == (row["outcome"] == "FAIL")
        assert cells["simulated"] == "true"
        assert (row["recipe_revision"], row["fruit_width_mm"]) == (
            cells["recipe_revision"],
            float(cells["fruit_width_mm"]),
        )
        assert (row["recipe_revision"], row["fruit_width_mm"]) == ("", 25.5)


def test_an_outcome_that_came_too_late_is_late_in_every_output(
    opened, scenario, trigger, passed, run_records, tmp_path
):
    nothing = {"area_mm2": None, "area_px": None, "closing_mm": None, "confidence": None}
    late = {"outcome": "NO_RESULT", "reasons": (Reason.LATE,), "late": True, "partial": True, **nothing}

    async def steps():
        async with opened() as records:
            judged = await records.conclude(await records.begin(trigger), passed)
            await records.published(judged.model_copy(update=late))
            await records.published(await records.conclude(await records.begin(trigger), passed))
            return [event.data for event in read_batch(records.folder, "s", 0).events if event.kind == "inspection"]

    events = scenario(steps)
    assert [event["late"] for event in events] == [True, False]
    run_records("export", tmp_path / "all.parquet")
    rows = pq.read_table(tmp_path / "all.parquet").to_pylist()
    for name in ("outcome", "reasons", "late", "partial", *nothing):
        assert [row[name] for row in rows] == [event[name] for event in events]
    run_records("export", tmp_path / "all.csv")
    with (tmp_path / "all.csv").open(newline="", encoding="utf-8") as file:
        assert [(row["late"], row["area_mm2"]) for row in csv.DictReader(file)] == [("true", ""), ("false", "31.5")]
    run_records("report", trigger.lot, tmp_path / "lot.html")
    text = (tmp_path / "lot.html").read_text(encoding="utf-8")
    assert "1 ended late." in text
    assert "1 of 2 fruit have an area." in text


def test_one_fruit_has_one_duration_in_every_output(opened, scenario, trigger, passed, folder, run_records, tmp_path):
    """Of what the PLC received, also if the judgement followed; none where it was not measured."""
    late = {"outcome": "NO_RESULT", "reasons": (Reason.LATE,), "late": True, "area_mm2": None, "area_px": None}

    async def judged_and_late():
        async with opened() as records:
            sequence = await records.begin(trigger)
            after = replace(passed, duration_ms=6400, ended_utc_ms=1_700_000_006_400)
            judged = await records.conclude(await records.begin(trigger), after)
            at = {"sequence": sequence, "duration_ms": 6000, "ended_utc_ms": 1_700_000_006_000}
            await records.published(judged.model_copy(update={**late, **at}))
            await records.conclude(sequence, after)
            await records.published(judged)
            await records.begin(trigger)

    async def lost():
        async with opened() as records:
            [outcome] = [each for each in (await records.open_inspections()).ended if each.sequence == 3]
            await records.published(outcome)
            return [InspectionDetails.of(read_record(records, number)) for number in (1, 2, 3)]

    scenario(judged_and_late)
    details = scenario(lost)
    assert [each.duration_s for each in details] == [6.0, 6.4, None]
    with reading(folder) as connection:
        listed = [InspectionSummary.model_validate(each) for each in read_summaries(connection, [1, 2, 3])]
    assert [each.duration_s for each in listed] == [None, 6.4, 6.0]
    run_records("export", tmp_path / "all.parquet")
    rows = pq.read_table(tmp_path / "all.parquet").to_pylist()
    events = [event.data for event in read_batch(folder, "s", 0).events if event.kind == "inspection"]
    for output in (rows, sorted(events, key=lambda event: event["sequence"])):
        assert [each["duration_ms"] for each in output] == [6000, 6400, None]
    assert [row["ended"] for row in rows] == [each.ended for each in details]
    assert summarise(folder, trigger.lot).mean_duration_s == 6.2
    shown = [run_records("show", number).output for number in (1, 2, 3)]
    assert [re.findall(r"took (\S+) s", text) for text in shown] == [["6.000"], ["6.400"], []]


@pytest.mark.parametrize("name", ["=1+1", "+1", "-1+2", "@SUM(A1)", "\t=1", "\r=1"])
def test_no_cell_of_a_csv_is_a_formula(opened, scenario, trigger, passed, run_records, tmp_path, name):
    async def steps():
        async with opened() as records:
            named = replace(trigger, lot=name)
            await records.published(
                await records.conclude(await records.begin(named), replace(passed, closing_mm=-1.0))
            )

    scenario(steps)
    run_records("export", tmp_path / "all.csv")
    with (tmp_path / "all.csv").open(newline="", encoding="utf-8") as file:
        (row,) = csv.DictReader(file)
    assert (row["lot"], row["closing_mm"]) == (f"'{name}", "-1.0")


def test_an_export_holds_what_was_asked_for(history, run_records, tmp_path):
    for conditions, number in ((("--lot", "other"), 3), (("--outcome", "FAIL"), 3), (("--reason", "early_stop"), 3)):
        result = run_records("export", tmp_path / "some.csv", *conditions)
        assert result.output.endswith(f": {number} inspections\n")
    assert run_records("export", tmp_path / "some.xlsx").exit_code == 2


def test_an_export_that_does_not_fit_leaves_the_file_as_it_was(history, folder, small_disk):
    target = small_disk / "all.csv"
    target.write_text("the last one")
    with contextlib.suppress(OSError), (small_disk / "filler").open("wb", buffering=0) as filler:
        while True:
            filler.write(bytes(4096))
    with pytest.raises(DiskFullError, check=because(messages.DISK_FULL)):
        export(folder, Query(), target)
    assert target.read_text() == "the last one"
    assert list(small_disk.glob(".*")) == []


def test_a_lots_report_needs_no_other_file_and_escapes_what_comes_from_outside(history, run_records, tmp_path):
    assert run_records("report", "a <b> & 'c'", tmp_path / "lot.html").exit_code == 0
    text = (tmp_path / "lot.html").read_text(encoding="utf-8")
    assert "Lot a &lt;b&gt; &amp; &#39;c&#39;" in text
    assert "<b>" in text
    assert "<b> &" not in text
    assert re.findall(r"(?:src|href)=\"(?!data:)", text) == []
    assert text.count("data:image/jpeg") == 2
    assert "<b>50.0 %</b>" in text
    assert "area over limit" in text
    assert run_records("report", "nothing", tmp_path / "none.html").exit_code == 1
    assert run_records("report", "other", tmp_path / "lot.doc").exit_code == 2


def test_who_asks_for_a_pdf_is_told_the_way(history, run_records, tmp_path):
    done = run_records("report", "other", tmp_path / "lot.pdf")
    assert done.exit_code == 2
    assert "expected a file that ends in .html; for paper or a PDF, print that file from a browser" in done.output


@pytest.mark.timeout(300)
def test_a_lots_report_is_printed_on_a4_with_lot_and_station_on_each_page(history, run_records, tmp_path, chromium):
    run_records("report", "a <b> & 'c'", tmp_path / "lot.html")
    sheet = (tmp_path / "lot.html").read_text(encoding="utf-8")
    name = r"a\000020\00003cb\00003e\000020\000026\000020\000027c\000027"  # no sign that could end a text of CSS
    assert f'@top-left {{ content: "Lot {name}"' in sheet
    assert r'@top-right { content: "station\00002d1"' in sheet
    pdf = tmp_path / "lot.pdf"
    options = (*ARGUMENTS, "--no-pdf-header-footer", f"--user-data-dir={tmp_path / 'p'}")
    command = [chromium, *options, f"--print-to-pdf={pdf}", (tmp_path / "lot.html").as_uri()]
    subprocess.run(command, capture_output=True, check=True, timeout=200)
    printed = pdf.read_bytes()
    sizes = re.findall(rb"/MediaBox\s*\[0 0 ([0-9.]+) ([0-9.]+)\]", printed)
    assert [(round(float(wide)), round(float(high))) for wide, high in sizes] == [(595, 842)] * len(sizes)
    assert 1 <= len(sizes) <= 2


def test_a_browser_shows_the_report(history, run_records, tmp_path, chromium):
    run_records("report", "other", tmp_path / "lot.html")
    profile, picture = tmp_path / "profile", tmp_path / "lot.png"
    options = (*ARGUMENTS, f"--user-data-dir={profile}", f"--screenshot={picture}")
    subprocess.run([chromium, *options, (tmp_path / "lot.html").as_uri()], capture_output=True, check=True, timeout=100)
    assert picture.stat().st_size > 10_000

"""`station records`: why was fruit 4,711 rejected?"""

import os
import subprocess
import sys
from dataclasses import replace

import pytest

from station.channel.line import Reason
from station.messages import records as messages
from station.messages.message import definition
from station.messages.reasons import reason_message
from station.records.texts import sparkline
from station.settings.recipe import find_recipe


@pytest.fixture
def history(opened, scenario, trigger, passed, failed, noise, settled):
    """One published and acknowledged, one judged and called off by the interface, one lost, one running."""

    async def steps():
        async with opened() as records:
            for _ in range(3):
                await records.begin(trigger)
            outcome = await records.conclude(1, replace(failed, images=(noise("reference", None), noise())))
            await records.published(outcome)
            await records.acknowledged(1)
            judged = await records.conclude(2, passed)
            called_off = judged.model_copy(update={"outcome": "NO_RESULT", "reasons": (Reason.CALLED_OFF,)})
            await records.published(called_off)
            await settled(records)
        async with opened() as records:
            await records.begin(replace(trigger, lot="\x1b[2Jevil"))

    scenario(steps)


def test_a_rejected_fruit_is_explained(history, failed, folder):
    environment = {**os.environ, "STATION_HOME": str(folder.parent)}
    command = [sys.executable, "-m", "station", "records", "show", "1"]
    output = subprocess.check_output(command, env=environment, text=True, timeout=100)
    assert "inspection 1: strawberry, FAIL" in output
    assert f"  {failed.explanation[0]}\n" in output
    assert f"area_over_limit: {reason_message(Reason.AREA_OVER_LIMIT)}" in output
    limit = find_recipe("strawberry").damage.area[0]
    assert f"fails above {limit.area_mm2:g} mm² at {limit.closing_mm:g} mm of closing" in output
    assert "▁▃▅▇█" in output
    assert "trigger:      7, encoder 1234, lot A-17" in output
    assert "2023-11-14 22:13:20.000 UTC, took 3.210 s" in output
    assert "acknowledged at" in output
    paths = [line.partition(": ")[2] for line in output.splitlines() if ".png" in line]
    assert len(paths) == 2
    assert all(os.path.exists(path) for path in paths)  # noqa: PTH110


def test_what_the_plc_was_told_stands_beside_what_was_judged(history, run_records):
    output = run_records("show", 2).output
    assert "judged:       PASS, area 31.5 mm² (44500 px) at 4.02 mm of closing" in output
    assert "in force:     NO_RESULT" in output
    assert f"called_off: {reason_message(Reason.CALLED_OFF)}" in output


def test_a_lost_and_a_running_one_say_so(history, run_records):
    assert f"station_lost: {reason_message(Reason.STATION_LOST)}" in run_records("show", 3).output
    running = run_records("show", 4).output
    assert "inspection 4: strawberry, running" in running
    assert "\x1b" not in running, "a lot's name commands no terminal"


def test_the_last_ones_are_listed_newest_first(history, run_records):
    lines = run_records("list", "--last", 3).output.splitlines()
    assert [line.split()[0] for line in lines] == ["number", "4", "3", "2", "more:"]
    assert "running" in lines[1]
    assert "called_off" in lines[3]
    assert len(run_records("list").output.splitlines()) == 5


def test_what_is_not_there_is_said_in_words(run_records, history, folder):
    missing = run_records("show", 99)
    assert missing.exit_code == 1
    assert missing.exception.remedy == messages.LIST_SHOWS_RANGE(first=1, last=4)
    assert run_records("show", 0).exit_code == 2
    lower = run_records("continue-after", 2)
    assert lower.exception.cause == messages.NUMBER_GIVEN(number=4)


def test_no_records_at_all(run_records, folder):
    assert run_records("list").exception.cause.id == messages.NO_RECORDS.id
    assert not folder.exists()


def test_every_reason_has_a_sentence():
    assert all(definition(f"reason.{reason}") for reason in Reason)
    assert str(reason_message("of_a_later_version")) == "of_a_later_version"


@pytest.mark.parametrize(
    ("values", "line"),
    [([], ""), ([0.0, 0.0], "▁▁"), ([None, 1.0, 2.0], "·▅█"), ([0.0, 7.9, 8.0], "▁██"), ([-1.0, 1.0], "▁█")],
)
def test_a_sparkline(values, line):
    assert sparkline(values) == line

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
    """One told and taken, one judged and called off by the interface, one lost, one running."""

    async def steps():
        async with opened() as records:
            for _ in range(3):
                await records.begin(trigger)
            outcome = await records.conclude(1, replace(failed, images=(noise("reference", None), noise())))
            await records.published(outcome)
            await records.acknowledged(1)
            judged = await records.conclude(2, passed)
            told = judged.model_copy(update={"outcome": "NO_RESULT", "reasons": (Reason.CALLED_OFF,)})
            await records.published(told)
            await settled(records)
        async with opened() as records:
            await records.begin(replace(trigger, lot="\x1b[2Jevil"))

    scenario(steps)


def test_a_rejected_fruit_is_explained(history, failed, folder):
    environment = {**os.environ, "STATION_HOME": str(folder.parent)}
    command = [sys.executable, "-m", "station", "records", "show", "1"]
    said = subprocess.check_output(command, env=environment, text=True, timeout=100)
    assert "inspection 1: strawberry, FAIL" in said
    assert f"  {failed.explanation[0]}\n" in said
    assert f"area_over_limit: {reason_message(Reason.AREA_OVER_LIMIT)}" in said
    limit = find_recipe("strawberry").damage.area[0]
    assert f"fails above {limit.area_mm2:g} mm² at {limit.closing_mm:g} mm of closing" in said
    assert "▁▃▅▇█" in said
    assert "trigger:      7, encoder 1234, lot A-17" in said
    assert "2023-11-14 22:13:20.000 UTC, took 3.210 s" in said
    assert "acknowledged at" in said
    paths = [line.partition(": ")[2] for line in said.splitlines() if ".png" in line]
    assert len(paths) == 2
    assert all(os.path.exists(path) for path in paths)  # noqa: PTH110


def test_what_the_plc_was_told_stands_beside_what_was_judged(history, ask):
    said = ask("show", 2).output
    assert "judged:       PASS, area 31.5 mm² (44500 px) at 4.02 mm of closing" in said
    assert "in force:     NO_RESULT" in said
    assert f"called_off: {reason_message(Reason.CALLED_OFF)}" in said


def test_a_lost_and_a_running_one_say_so(history, ask):
    assert f"station_lost: {reason_message(Reason.STATION_LOST)}" in ask("show", 3).output
    running = ask("show", 4).output
    assert "inspection 4: strawberry, running" in running
    assert "\x1b" not in running, "a lot's name commands no terminal"


def test_the_last_ones_are_listed_newest_first(history, ask):
    lines = ask("list", "--last", 3).output.splitlines()
    assert [line.split()[0] for line in lines] == ["number", "4", "3", "2", "more:"]
    assert "running" in lines[1]
    assert "called_off" in lines[3]
    assert len(ask("list").output.splitlines()) == 5


def test_what_is_not_there_is_said_in_words(ask, history, folder):
    missing = ask("show", 99)
    assert missing.exit_code == 1
    assert missing.exception.remedy == messages.LIST_SHOWS_RANGE(first=1, last=4)
    assert ask("show", 0).exit_code == 2
    lower = ask("continue-after", 2)
    assert lower.exception.cause == messages.NUMBER_GIVEN(number=4)


def test_no_records_at_all(ask, folder):
    assert ask("list").exception.cause.id == messages.NO_RECORDS.id
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

"""When a move counts as done, on a wire that a test writes line by line."""

import asyncio
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import pytest

from station.devices.gripper import robotiq
from station.devices.gripper.errors import GripperTimeoutError
from station.devices.gripper.link import State, Status
from station.devices.gripper.robotiq import Robotiq2F85
from station.messages import gripper as messages
from station.settings.gripper import GripperSettings
from tests.devices.gripper.scripted_link import ScriptedLink

START = Status(state=State.ACTIVE, go_to=True, object_=3, fault=0, echo=50, position=50, current_a=None)
TARGET = 53
"""A millimetre further than 50: the count nearest to a width of 34.3 mm."""
WIDTH_MM = 34.3
SHORT_S = 0.1


def moved(link: ScriptedLink, margin_s: float = 10.0) -> int:
    """Move; the margin is longer than a busy machine pauses, but where its end is what is tested."""
    gripper = Robotiq2F85(link, GripperSettings(move_margin_s=margin_s))
    return asyncio.run(gripper.move_to_width(WIDTH_MM, 100.0, 20.0)).reading.position_count


def test_an_object_state_from_before_the_move_is_not_taken_for_arrival():
    stale = replace(START, echo=TARGET, position=51)
    moving, there = replace(stale, object_=0, position=52), replace(stale, position=TARGET)
    link = ScriptedLink(START, replace(START, echo=TARGET), stale, moving, there)
    assert moved(link) == TARGET
    assert link.sent == [f"go_to {TARGET}"]


@pytest.mark.parametrize(("reached", "readings"), [(TARGET, 1), (TARGET - 1, 2)])
def test_fingers_at_the_place_itself_have_arrived_and_others_rest_for_two_readings(reached, readings):
    class CountingLink(ScriptedLink):
        at_rest = 0

        async def status(self) -> Status:
            status = await super().status()
            self.at_rest += status.position == reached
            return status

    at_rest = replace(START, echo=TARGET, position=reached)
    link = CountingLink(START, replace(at_rest, object_=0, position=51), at_rest)
    assert moved(link) == reached
    assert link.at_rest == readings


def test_contact_ends_the_move_once_the_fingers_stand():
    touching = replace(START, echo=TARGET, object_=2, position=51)
    assert moved(ScriptedLink(START, touching, replace(touching, position=52))) == 52


def test_fingers_that_arrived_are_not_late_because_their_answers_are_read_late():
    class SlowLink(ScriptedLink):
        async def status(self) -> Status:
            await asyncio.sleep(1.5 * SHORT_S)
            return await super().status()

    link = SlowLink(START, replace(START, echo=TARGET, position=TARGET))
    assert moved(link, SHORT_S) == TARGET
    assert link.sent == [f"go_to {TARGET}"]


def test_a_report_of_no_communication_after_a_pause_does_not_count_from_that_before_it(monkeypatch):
    now_s = 100.0
    monkeypatch.setattr(robotiq, "time", SimpleNamespace(monotonic=lambda: now_s))
    there = replace(START, echo=TARGET, position=TARGET)
    mute = replace(there, fault=9)
    gripper = Robotiq2F85(ScriptedLink(mute, mute, mute, there), GripperSettings())

    async def scenario() -> None:
        nonlocal now_s
        assert (await gripper.move_to_width(WIDTH_MM, 100.0, 20.0)).reading.fault_code == 9
        now_s += 60.0
        assert (await gripper.move_to_width(WIDTH_MM, 100.0, 20.0)).reading.fault_code == 0

    asyncio.run(scenario())


@pytest.mark.parametrize(("answers_in_s", "every_s"), [(0.002, 0.005), (0.008, 0.008)])
def test_a_moving_gripper_is_asked_as_often_as_it_refreshes_however_long_an_answer_takes(
    monkeypatch, answers_in_s, every_s
):
    now_s, polled_s = 100.0, list[float]()

    class TimedLink(ScriptedLink):
        async def status(self) -> Status:
            nonlocal now_s
            polled_s.append(now_s)
            now_s += answers_in_s
            return await super().status()

    async def sleep(duration_s: float) -> None:
        nonlocal now_s
        now_s += duration_s

    monkeypatch.setattr(robotiq, "time", SimpleNamespace(monotonic=lambda: now_s))
    monkeypatch.setattr(robotiq.asyncio, "sleep", sleep)
    moving = replace(START, echo=TARGET, object_=0, position=51)
    assert moved(TimedLink(START, moving, moving, replace(START, echo=TARGET, position=TARGET))) == TARGET
    assert [after - before for before, after in pairwise(polled_s[1:])] == pytest.approx([every_s] * 2)


@pytest.mark.parametrize(
    "never",
    [
        replace(START, echo=TARGET, object_=0, position=TARGET),
        replace(START, echo=TARGET - 1, position=TARGET),
        replace(START, echo=TARGET, position=TARGET - 3),
    ],
    ids=["still moving", "another master's request", "somewhere else"],
)
def test_what_is_no_arrival_ends_in_a_time_out_and_a_halt(never: Status):
    link = ScriptedLink(START, never)
    with pytest.raises(GripperTimeoutError) as caught:
        moved(link, SHORT_S)
    assert caught.value.cause.parameters["step"] == messages.STEP_MOVE(count=TARGET)
    assert link.sent == [f"go_to {TARGET}", "halt"]

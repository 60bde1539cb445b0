"""The station's driver over each wire, with nothing wrong."""

import asyncio
import time
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest

from station.devices.gripper.errors import (
    GripperFaultError,
    GripperNotActiveError,
    GripperRequestError,
    GripperStoppedError,
)
from station.devices.gripper.interface import Gripper, ObjectState
from station.devices.gripper.probe import probe_gripper
from station.messages import gripper as messages
from station.twin.robotiq.load import Spring
from station.twin.robotiq.registers import Command

OnWire = Callable[..., Any]
DIGIT_MM = 32.0
HALF_COUNT_MM = 85 / 227 / 2


def test_activation_makes_ready_once_and_then_moves_nothing(on_wire: OnWire):
    async def scenario(rig: Any) -> None:
        rig.twin.write(Command())
        with pytest.raises(GripperNotActiveError) as caught:
            await rig.driver.open()
        assert caught.value.cause == messages.NOT_ACTIVE()
        assert not (await rig.driver.read()).active
        began_s = time.monotonic()
        assert (await rig.driver.activate()).active
        assert time.monotonic() - began_s >= 2 * 85 / 150
        await rig.driver.move_to_width(50.0, 150.0, 20.0)
        before = await rig.driver.read()
        again = await rig.driver.activate()
        assert again.active
        assert again.position_count == before.position_count

    on_wire(scenario)


def test_a_fruit_is_closed_on_in_steps_of_a_millimetre_and_the_width_is_measured(on_wire: OnWire):
    async def scenario(rig: Any) -> None:
        gripper: Gripper = rig.driver
        rig.load(Spring(free_mm=DIGIT_MM + 44.0, stiffness_n_per_mm=1.5))
        await gripper.move_to_width(47.0, 150.0, 20.0)
        widths_mm = []
        for target_mm in range(46, 32, -1):
            began_s = time.monotonic()
            result = await gripper.move_to_width(target_mm, 60.0, 20.0)
            assert result.reading.object_state == ObjectState.AT_POSITION
            assert abs(result.width_mm - target_mm) <= HALF_COUNT_MM + 1e-6
            assert began_s <= result.reading.at_s <= time.monotonic()
            true_mm = rig.twin.opening_mm(rig.clock.now_s()) - DIGIT_MM
            assert abs(result.width_mm - true_mm) <= HALF_COUNT_MM + 1e-6
            widths_mm.append(result.width_mm)
        assert all(wide - narrow > 0.5 for wide, narrow in pairwise(widths_mm))

    on_wire(scenario)


def test_contact_ends_a_move_and_a_drop_is_seen(on_wire: OnWire):
    async def scenario(rig: Any) -> None:
        rig.load(Spring(free_mm=DIGIT_MM + 50.0, stiffness_n_per_mm=40.0))
        result = await rig.driver.move_to_width(20.0, 150.0, 20.0)
        assert result.reading.object_state == ObjectState.CONTACT_CLOSING
        assert result.width_mm == pytest.approx(49.5, abs=HALF_COUNT_MM)
        assert (await rig.driver.read()).object_state == ObjectState.CONTACT_CLOSING
        rig.faults.set("object_dropped")
        assert (await rig.driver.read()).object_state == ObjectState.LOST

    on_wire(scenario)


def test_current_is_read_where_the_wire_carries_it(on_wire: OnWire, wire: str):
    async def scenario(rig: Any) -> list[float | None]:
        moving = asyncio.create_task(rig.driver.move_to_width(0.0, 40.0, 20.0))
        await rig.until(lambda: rig.twin.status().current > 0)
        rig.clock.hold()  # what the wire carries is the same now, however late it is read
        current_a = (await rig.driver.read()).current_a
        rig.clock.go_on()
        await rig.driver.stop()
        with pytest.raises(GripperStoppedError):
            await moving
        return [current_a, (await rig.driver.read()).current_a]

    assert on_wire(scenario) == ([None, None] if wire == "urcap" else [0.1, 0.0])


def test_stop_ends_the_move_and_the_fingers_stand(on_wire: OnWire):
    async def scenario(rig: Any) -> None:
        moving = asyncio.create_task(rig.driver.move_to_width(5.0, 20.0, 20.0))
        await rig.until(lambda: rig.twin.status().go_to)
        stopped = await rig.driver.stop()
        with pytest.raises(GripperStoppedError):
            await moving
        assert stopped.object_state == ObjectState.IDLE
        assert stopped.active
        rig.clock.skip(10.0)
        assert (await rig.driver.stop()).position_count == stopped.position_count

    on_wire(scenario)


def test_stop_also_ends_a_move_that_waits_for_its_turn(on_wire: OnWire):
    async def scenario(rig: Any) -> None:
        moves = [asyncio.create_task(rig.driver.move_to_width(width, 20.0, 20.0)) for width in (5.0, 10.0)]
        await rig.until(lambda: rig.twin.status().go_to)
        await rig.driver.stop()
        ends = await asyncio.gather(*moves, return_exceptions=True)
        assert [type(end) for end in ends] == [GripperStoppedError, GripperStoppedError]
        assert not rig.twin.status().go_to

    on_wire(scenario)


def test_stop_does_not_activate_a_gripper_that_is_not(on_wire: OnWire):
    async def scenario(rig: Any) -> None:
        rig.twin.write(Command())
        await rig.driver.stop()
        assert not rig.twin.status().activate

    on_wire(scenario)


def test_a_cancelled_move_stops_the_fingers(on_wire: OnWire):
    async def scenario(rig: Any) -> None:
        moving = asyncio.create_task(rig.driver.move_to_width(5.0, 20.0, 20.0))
        await rig.until(lambda: rig.twin.status().go_to)
        rig.clock.hold()  # on a busy machine they would be at the end of what they were sent before it is cancelled
        rig.faults.set("delayed", 0.02)
        await asyncio.sleep(0.03)  # most likely in mid-exchange, though no moment may do harm
        moving.cancel()
        with pytest.raises(asyncio.CancelledError):
            await moving
        assert not rig.twin.status().go_to
        rig.clock.skip(10.0)
        status = rig.twin.status()
        assert status.position < status.echo
        rig.clock.go_on()
        assert (await rig.driver.open()).reading.object_state == ObjectState.AT_POSITION

    on_wire(scenario, answer_timeout_s=4.0)


def test_a_request_out_of_reach_sends_nothing(on_wire: OnWire):
    async def scenario(rig: Any) -> None:
        before = rig.twin.command
        for request in ((60.0, 50.0, 20.0), (40.0, 5.0, 20.0), (40.0, 50.0, 5.0)):
            with pytest.raises(GripperRequestError):
                await rig.driver.move_to_width(*request)
        assert rig.twin.command == before

    on_wire(scenario)


def test_an_automatic_release_will_open_the_fingers(on_wire: OnWire):
    async def scenario(rig: Any) -> None:
        rig.twin.write(Command())
        await rig.activate()
        assert rig.twin.command.release_opens
        await rig.driver.move_to_width(50.0, 150.0, 20.0)
        assert rig.twin.command.release_opens

    on_wire(scenario)


def test_open_lets_go_and_is_idempotent(on_wire: OnWire):
    async def scenario(rig: Any) -> None:
        await rig.driver.move_to_width(45.0, 150.0, 20.0)
        for _ in range(2):
            assert (await rig.driver.open()).width_mm == pytest.approx(rig.driver.max_width_mm)

    on_wire(scenario)


def test_verbs_take_turns_while_read_does_not_wait(on_wire: OnWire):
    async def scenario(rig: Any) -> None:
        rig.clock.hold()  # else the first may have arrived on a busy machine before it is read
        one = asyncio.create_task(rig.driver.move_to_width(47.0, 100.0, 20.0))
        other = asyncio.create_task(rig.driver.move_to_width(50.0, 100.0, 20.0))
        await rig.until(lambda: rig.twin.status().go_to)
        assert (await rig.driver.read()).object_state == ObjectState.MOVING
        rig.clock.go_on()
        assert (await one).width_mm == pytest.approx(47.0, abs=0.2)
        assert (await other).width_mm == pytest.approx(50.0, abs=0.2)

    on_wire(scenario)


def test_close_is_idempotent_and_a_later_verb_opens_the_wire_again(on_wire: OnWire):
    async def scenario(rig: Any) -> None:
        await rig.driver.read()
        await rig.driver.close()
        await rig.driver.close()
        assert (await rig.driver.read()).age_s(time.monotonic()) < 5.0

    on_wire(scenario)


def test_the_probe_says_what_is_there_and_moves_nothing(on_wire: OnWire):
    async def scenario(rig: Any) -> None:
        before = rig.twin.command
        (finding,) = await probe_gripper(rig.settings)
        assert (finding.verdict, finding.remedy) == ("ok", None)
        assert finding.found.parameters["count"] == 3
        assert finding.found.parameters["width_mm"] == pytest.approx(53.0)
        assert rig.twin.command == before
        rig.faults.set("overcurrent")
        (finding,) = await probe_gripper(rig.settings)
        assert finding.verdict == "fault"
        assert finding.found.parameters["trouble"] == GripperFaultError(0xE).cause
        rig.faults.clear()
        rig.twin.write(Command())
        rig.twin.write(Command(activate=True))
        rig.twin.write(Command())
        (finding,) = await probe_gripper(rig.settings)
        assert finding.verdict == "warning"
        assert finding.remedy == messages.REMEDY_CLEAR_AND_ACTIVATE()
        await rig.server.stop()
        (finding,) = await probe_gripper(rig.settings)
        assert finding.verdict == "fault"
        assert finding.remedy

    on_wire(scenario)

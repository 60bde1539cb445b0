"""Holds that only a person may end: found again by the next start, after a kill at any step."""

import asyncio
import subprocess
import sys
import time
from pathlib import Path

import pytest

from station.inspection.cycle import LATCHES, STOPPED_FOR_A_PERSON, Action, Event
from station.inspection.states import STATES, State
from station.runtime.cycle.hold import FILE_NAME
from station.runtime.cycle.runner import CycleRunner
from tests.runtime.cycle.held_states import WAYS, Performer, hold_of

FRUIT = {State.PLACING_ACCEPT, State.PLACING_REJECT, State.CARRIED}
ENDS = {
    (State.PLACING_ACCEPT, Event.PLACED),
    (State.CARRIED, Event.PERSON_CONFIRMED),
    (State.RECOVERING, Event.RECOVERED),
}
"""After these the hold may be gone although the state does not show it yet."""
NOTHING_MOVES = {Action.HALT, Action.READ_DEVICES}


@pytest.fixture
def killed_at(tmp_path):
    """Kill a cycle on its way before a step; its last state and event, and whether it was killed at all."""
    program = [sys.executable, "-m", "tests.runtime.cycle.held_states"]
    with subprocess.Popen(program, stdin=-1, stdout=-1, text=True, cwd=Path(__file__).parents[3]) as nursery:
        orders, shown = nursery.stdin, nursery.stdout
        assert orders is not None
        assert shown is not None

        def kill(way, step):
            folder = tmp_path / f"{way} {step}"
            folder.mkdir()
            orders.write(f"{way}\t{step}\t{folder}\n")
            orders.flush()
            state, event = State.UNKNOWN, None
            for line in shown:
                kind, value = line.split()
                match kind:
                    case "State":
                        state = State(value)
                    case "Event":
                        event = Event(value)
                    case _:
                        assert value in ("killed", "0"), "it fails by itself"
                        return folder, state, event, value == "killed"
            raise AssertionError("the cycles' process has ended")

        yield kill
        orders.close()


def start(folder):
    """A start after a kill: its state once everything but a person has happened, and what it did."""

    async def scenario():
        hold = hold_of(folder)
        performer = Performer(hold, lambda: None, lambda _state: None)
        runner = CycleRunner(performer, hold.event)
        began = runner.state
        running = asyncio.create_task(runner.run())
        if began is not State.UNKNOWN:
            for event in set(Event) - {Event.PERSON_CONFIRMED}:
                runner.post(event)
            while not runner._events.empty():
                await asyncio.sleep(0)
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        return began, runner.state, performer.performed

    return asyncio.run(scenario())


@pytest.mark.parametrize("way", WAYS)
def test_a_station_killed_at_any_step_is_still_held_and_moves_nothing(killed_at, way):
    step, was_killed, held, began = 0, True, 0, None
    while was_killed:
        folder, state, event, was_killed = killed_at(way, step)
        began, remains, performed = start(folder)
        held_as = State.CARRIED if state in FRUIT else State.LATCHED if state in STOPPED_FOR_A_PERSON else None
        if held_as is not None and not ((state, event) in ENDS and began is State.UNKNOWN):
            assert began in (held_as, State.LATCHED if event in LATCHES else held_as), (step, state, event)
        if began is not State.UNKNOWN:
            held += 1
            assert STATES[remains].needs_person, (step, remains)
            assert set(performed) <= NOTHING_MOVES, (step, performed)
        step += 1
    assert held > len(WAYS[way]) / 4
    assert began is State.UNKNOWN, "what a person has ended is not found again"


def test_a_file_that_cannot_be_read_counts_as_a_held_fruit(tmp_path):
    (tmp_path / FILE_NAME).write_bytes(b"")
    assert start(tmp_path)[0] is State.CARRIED
    (tmp_path / FILE_NAME).unlink()
    (tmp_path / FILE_NAME).mkdir()
    assert start(tmp_path)[0] is State.CARRIED


def test_a_stop_that_comes_in_a_latched_cycle_is_noted_although_it_enters_no_state(tmp_path):
    async def scenario():
        performer = Performer(hold_of(tmp_path), lambda: None, lambda _state: None)
        runner = CycleRunner(performer, Event.PROTECTIVE_STOP)
        running = asyncio.create_task(runner.run())
        await runner.taken()
        entered_s, before_s = runner.entered_s, time.monotonic()
        runner.post(Event.EMERGENCY_STOP)
        await runner.taken()
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        assert (runner.state, runner.entered_s) == (State.LATCHED, entered_s)
        assert runner.stopped_s >= before_s

    asyncio.run(scenario())

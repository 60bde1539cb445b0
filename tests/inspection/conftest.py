"""Model of the cycle for its tests: the cell and the line beside the table's state, which the table cannot see."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import pytest

from station.inspection.cycle import LATCHES, START, TABLE, Act, Action, Cycle, Event, Raise, hold_after
from station.inspection.states import State

JAWS_CLOSE = {Action.CLOSE_TO_ONSET, Action.CLOSE_STEP}
ARM_LEAVES = {Action.APPROACH, Action.CENTRE, Action.GO_HOME}
MOVES = JAWS_CLOSE | ARM_LEAVES | {Action.OPEN_JAWS, Action.FREE_FRUIT, Action.PLACE_ACCEPT, Action.PLACE_REJECT}


@dataclass(frozen=True)
class World:
    """A node of the model: the cycle's state, and what is true of fruit, arm and line beside it."""

    state: State = START.state
    jaws_open: bool = False
    """Known to be open, and nothing has closed them since."""
    stopped_for_a_person: bool = False
    hold: Event | None = None
    """Stored for the next start."""
    accepted: int = 0
    """Triggers accepted and not answered with an outcome."""
    recorded: bool = False
    """The outcome of the accepted trigger is durable."""


class BrokenError(AssertionError):
    """An invariant does not hold."""


def after(world: World, event: Event) -> World | None:
    """The world after an event, with every invariant checked; None where the event cannot happen or is refused."""
    if world.stopped_for_a_person and event == Event.READY:
        return None
    transition = TABLE.get((world.state, event))
    if transition is None:
        return None
    if event in LATCHES:
        world = replace(world, stopped_for_a_person=True)
    elif event == Event.RECOVERED:
        world = replace(world, stopped_for_a_person=False)
    elif event in (Event.JAWS_OPEN, Event.PLACED):
        world = replace(world, jaws_open=True)
    elif event == Event.RECORDED:
        world = replace(world, recorded=True)
    elif event == Event.UNFINISHED_CLOSED:
        world = replace(world, accepted=0, recorded=False)
    elif event == Event.PERSON_CONFIRMED:
        world = replace(world, jaws_open=False)
    for action in transition.actions:
        world = carried_out(world, action, event)
    hold = hold_after(event, transition.state, world.hold, carries=True)
    return replace(world, state=transition.state, hold=hold)


def carried_out(world: World, action: Act, event: Event) -> World:
    """The world while and after an action is carried out."""
    if isinstance(action, Raise):
        return world
    if world.stopped_for_a_person and action in MOVES:
        raise BrokenError(f"{action} in a latched stop: {world}, {event}")
    if action in ARM_LEAVES and not world.jaws_open:
        raise BrokenError(f"{action} with jaws that may hold a fruit: {world}, {event}")
    if action in JAWS_CLOSE:
        return replace(world, jaws_open=False)
    if action == Action.ACCEPT_TRIGGER:
        if world.accepted:
            raise BrokenError(f"a second trigger accepted: {world}")
        return replace(world, accepted=1, recorded=False)
    if action == Action.PUBLISH:
        if world.accepted != 1 or not world.recorded:
            raise BrokenError(f"an outcome without a record or without a trigger: {world}, {event}")
        return replace(world, accepted=0, recorded=False)
    return world


def killed(world: World) -> World:
    """The process ended with SIGKILL and was started again: what is durable and what is real stays."""
    return World(
        state=Cycle(world.hold).state,
        stopped_for_a_person=world.stopped_for_a_person,
        hold=world.hold,
        accepted=world.accepted,
        recorded=world.recorded,
    )


def neighbours(world: World) -> Iterator[tuple[str, World]]:
    """Every world that one event, a crash, or a hand on the gripper's own panel leads to."""
    for event in Event:
        if (following := after(world, event)) is not None:
            yield event, following
    yield "killed", killed(world)
    if world.state in (State.UNKNOWN, State.STOPPED, State.HELD, State.CARRIED, State.LATCHED):
        yield "gripped by hand", replace(world, jaws_open=False)


@pytest.fixture(scope="session")
def cycle_model() -> dict[World, dict[str, World]]:
    """Every reachable world with its neighbours by event."""
    reached: dict[World, dict[str, World]] = {}
    todo = [World()]
    while todo:
        world = todo.pop()
        if world not in reached:
            reached[world] = dict(neighbours(world))
            todo.extend(reached[world].values())
    return reached

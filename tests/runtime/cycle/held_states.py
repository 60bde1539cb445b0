"""A cycle that enters and leaves every state which only a person may end, and is killed at one of its steps.

Reads lines `WAY STEP FOLDER` and forks a cycle for each, which writes every event and every state that it shows. It
ends with SIGKILL before the step of that number: a call to the disk, a change of the state, or an action.
"""

import asyncio
import os
import signal
import sys
from pathlib import Path
from typing import Any

from station.inspection.cycle import Event
from station.inspection.states import State
from station.runtime.cycle.hold import Hold
from station.runtime.cycle.runner import CycleRunner
from station.state_files import StateFiles

E, S = Event, State
TO_IDLE = (
    (E.READY, S.CLEARING), (E.UNFINISHED_CLOSED, S.STOPPED), (E.RESET, S.RESETTING), (E.JAWS_OPEN, S.HOMING),
    (E.HOME, S.CHECKING), (E.READY, S.IDLE),
)  # fmt: skip
TO_FRUIT = (
    *TO_IDLE, (E.TRIGGER, S.ACCEPTING), (E.TRIGGER_RECORDED, S.REFERENCE), (E.JAWS_OPEN, S.APPROACHING),
    (E.ARRIVED, S.CLOSING_TO_ONSET),
)  # fmt: skip
TO_PLACING = (
    *TO_FRUIT, (E.ONSET_FOUND, S.MOVING), (E.REACHED, S.SETTLING), (E.SETTLED, S.CAPTURING),
    (E.LAST_CAPTURED, S.MEASURING_LAST), (E.MEASURED, S.JUDGING), (E.JUDGED_ACCEPT, S.RECORDING_ACCEPT),
    (E.RECORDED, S.PLACING_ACCEPT),
)  # fmt: skip
RECOVERED = ((E.PERSON_CONFIRMED, S.RECOVERING), (E.RECOVERED, S.UNKNOWN), (E.READY, S.CLEARING))
WAYS: dict[str, tuple[tuple[Event, State], ...]] = {
    "placed": (*TO_PLACING, (E.PLACED, S.RETREATING_READY)),
    "carried": (*TO_PLACING, (E.ARM_FAULT, S.CARRIED), (E.PERSON_CONFIRMED, S.UNKNOWN), (E.READY, S.CLEARING)),
    "carried, then stopped": (
        *TO_PLACING, (E.GRIPPER_FAULT, S.CARRIED), (E.EMERGENCY_STOP, S.LATCHED), *RECOVERED
    ),
    "stopped at once": ((E.EMERGENCY_STOP, S.LATCHED), *RECOVERED),
    "stopped while idle": (*TO_IDLE, (E.PROTECTIVE_STOP, S.LATCHED), *RECOVERED),
    "stopped on the pendant": (*TO_IDLE, (E.PROGRAM_STOPPED, S.LATCHED), *RECOVERED),
    "stopped in an inspection": (
        *TO_FRUIT, (E.SAFETY_FAULT, S.RECORDING_LATCHED), (E.RECORDED, S.LATCHED), (E.PERSON_CONFIRMED, S.RECOVERING),
        (E.ARM_FAULT, S.LATCHED), *RECOVERED,
    ),
}  # fmt: skip
"""Events, and the state that each leads to."""


def hold_of(folder: Path) -> Hold:
    """The hold of a station whose arm carries fruit."""
    return Hold(StateFiles(folder), carries=True)


class Performer:
    """Carries nothing out. Every call is a step.

    Args:
        step: called before each.
        show: gets every state at the moment at which others can read it.
    """

    def __init__(self, hold: Hold, step: Any, show: Any) -> None:
        self.hold, self.step, self.show, self.performed = hold, step, show, []

    def storing(self, event: Event, state: State) -> Any:
        return self.hold.store() if self.hold.changes(event, state) else None

    def perform(self, action: Any, because: Any) -> None:
        self.step()
        self.performed.append(action)

    async def halt(self) -> None:
        self.step()

    def raise_alarm(self, alarm: Any, why: Any) -> None:
        self.step()

    def entered(self, state: State, after: State, took_s: float) -> None:
        self.show(state)
        self.step()

    def failed(self, fault: Any) -> None: ...

    def refused(self, state: State, event: Event) -> None: ...

    def tick(self) -> None: ...


def stepwise(step: Any) -> None:
    """Make every call to the disk a step."""
    for place, name in ((os, "fsync"), (os, "fchmod"), (os, "replace")):
        call = getattr(place, name)

        def stepped(*args: Any, _call: Any = call, **kwargs: Any) -> Any:
            step()
            return _call(*args, **kwargs)

        setattr(place, name, stepped)


async def go(way: str, folder: Path, step: Any, show: Any) -> None:
    """Go a way to its end."""
    hold = hold_of(folder)
    runner = CycleRunner(Performer(hold, step, show), hold.event)
    running = asyncio.create_task(runner.run())
    for event, state in WAYS[way]:
        show(event)
        runner.post(event)
        await runner.until(lambda now, state=state: now is state)
        step()
    running.cancel()
    await asyncio.gather(running, return_exceptions=True)


def main() -> None:
    """Fork a cycle for each line."""
    for line in sys.stdin:
        way, number, folder = line.rstrip("\n").split("\t")
        child = os.fork()
        if child == 0:
            left = [int(number)]

            def step(left: list[int] = left) -> None:
                left[0] -= 1
                if left[0] < 0:
                    os.kill(os.getpid(), signal.SIGKILL)

            def show(what: Event | State) -> None:
                os.write(1, f"{type(what).__name__} {what}\n".encode())

            stepwise(step)
            asyncio.run(go(way, Path(folder), step, show))
            os._exit(0)
        _, status = os.waitpid(child, 0)
        os.write(1, f"ended {'killed' if os.WIFSIGNALED(status) else os.waitstatus_to_exitcode(status)}\n".encode())


if __name__ == "__main__":
    main()

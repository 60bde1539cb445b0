"""Scenario files: the fault put on the station, its moment in the cycle, and the outcome that is expected."""

from enum import StrEnum
from pathlib import Path
from typing import Literal

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

from station.errors import BadInputError
from station.inspection.alarm_table import AlarmId
from station.vocabulary import Reason


class Phase(StrEnum):
    """A moment of the cycle that can be seen from outside the station."""

    TRIGGER = "trigger"
    """The PLC has seen its trigger accepted."""
    APPROACH = "approach"
    """The arm moves towards the fruit, by its controller's RTDE; the reference is taken on this way."""
    CLOSING = "closing"
    """The jaws close without a stop, and do not touch the fruit yet, by the twin."""
    STEPPING = "stepping"
    """The jaws have deformed the fruit by half a millimetre, by the twin."""
    RELEASING = "releasing"
    """The PLC sees the result; the jaws open."""
    LEAVING = "leaving"
    """The PLC has seen its next trigger accepted while the arm leaves the fruit before, which has got PASS."""


_EVERY_FRUIT = (Phase.TRIGGER, Phase.APPROACH, Phase.STEPPING, Phase.RELEASING)


class _Checked(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class DeviceFault(_Checked):
    """A fault of the twin."""

    kind: Literal["device"] = "device"
    device: Literal["arm", "gripper", "camera"]
    fault: str
    amount: float = 1.0


class ProcessFault(_Checked):
    """A signal to one of the station's processes; the supervisor starts again what ends."""

    kind: Literal["process"] = "process"
    process: Literal["service", "plc", "hmi", "arm"]
    """`arm` is the process that the service talks to the arm's controller through."""
    signal: Literal["SIGKILL", "SIGSTOP", "SIGTERM"]


class DiskFault(_Checked):
    """The records' disk."""

    kind: Literal["disk"] = "disk"
    disk: Literal["full", "read_only"]
    """`read_only` kills the service first, as a file system with open files cannot be made so."""


class ClockFault(_Checked):
    """The machine's clock is set, as its processes see it; taking it back sets it again."""

    kind: Literal["clock"] = "clock"
    step_s: float


class NestFault(_Checked):
    """The fruit is gone from between the jaws, and does not come back."""

    kind: Literal["nest"] = "nest"


class PlcFault(_Checked):
    """The line's PLC."""

    kind: Literal["plc"] = "plc"
    plc: Literal["lost", "nonsense"]
    """`lost`: it cuts its connection and is away. `nonsense`: it sets every bit, with numbers that there are not."""


Fault = DeviceFault | ProcessFault | DiskFault | ClockFault | NestFault | PlcFault


class Expected(_Checked):
    """Expected outcome of the fruit, with its reasons."""

    outcomes: tuple[Literal["PASS", "FAIL", "NO_RESULT"], ...]
    reasons: tuple[Reason, ...] = ()
    """One of them is given; none has to be where empty, or where the outcome is PASS."""


class Scenario(_Checked):
    """One fault, in some phases of the cycle, a fruit each."""

    name: str
    fault: Fault | None
    """None for a fruit that nothing happens to."""
    lasts_s: float = 3.0
    """Then it is taken back."""
    phases: tuple[Phase, ...] = _EVERY_FRUIT
    measured: Literal["at_rest", "while_closing"] = "at_rest"
    """The recipe's `steps.measured`."""
    expected: Expected
    expected_in: dict[Phase, Expected] = {}
    """Where a phase differs."""
    alarm: AlarmId | None = None
    """Is raised, in each phase but `releasing`, in which the station may not need what failed any more."""
    remedy: tuple[str, ...] = ()
    """A person's, in order: `recover …` is `station devices recover …`, `reset` the PLC's command. Empty where the
    station has to come back by itself; else it must not."""
    remark: str = ""

    def of(self, phase: Phase) -> Expected:
        """Return the expected outcome in a phase.

        Args:
            phase: one of the scenario's.
        """
        return self.expected_in.get(phase, self.expected)


class _File(_Checked):
    scenarios: tuple[Scenario, ...]


def load_scenarios(folder: Path) -> list[Scenario]:
    """Read every file of a folder.

    Args:
        folder: of `*.yaml`.

    Raises:
        BadInputError: a file is wrong, or a name is given twice.
    """
    found: list[Scenario] = []
    for path in sorted(folder.glob("*.yaml")):
        try:
            found += _File.model_validate(yaml.safe_load(path.read_text(encoding="utf-8"))).scenarios
        except (ValidationError, yaml.YAMLError) as error:
            raise BadInputError(f"{path}: {error}") from error
    names = [scenario.name for scenario in found]
    if doubled := {name for name in names if names.count(name) > 1}:
        raise BadInputError(f"{folder}: given twice: {', '.join(sorted(doubled))}")
    return found

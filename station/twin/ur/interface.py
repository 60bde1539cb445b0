"""Interface of a UR controller for its servers."""

from collections.abc import Callable, Mapping
from typing import Any, Protocol

from station.twin.clock import Clock
from station.twin.faults import FaultBoard
from station.twin.ur.body import Body
from station.twin.ur.inputs_outputs import InputsOutputs
from station.twin.ur.registers import Registers
from station.twin.ur.safety import Safety
from station.twin.ur.script import ControlScript

Getter = Callable[[], tuple[Any, ...]]
"""Source of an RTDE output's value, one element for each of its numbers."""


class Controller(Protocol):
    """A UR controller, as its dashboard, RTDE and primary servers know it."""

    host: str
    clock: Clock
    faults: FaultBoard
    polyscope: tuple[int, int]
    version: tuple[int, int, int, int]
    version_text: str
    serial_number: str
    speed_slider: float
    body: Body
    registers: Registers
    inputs_outputs: InputsOutputs
    safety: Safety
    script: ControlScript

    @property
    def outputs(self) -> Mapping[str, tuple[str, Getter]]:
        """Every RTDE output but the registers, by name: its type and its source."""
        ...

    @property
    def uptime_s(self) -> float:
        """RTDE `timestamp`."""
        ...

    @property
    def timestamp_us(self) -> int:
        """The primary stream's timestamp."""
        ...

    @property
    def speed_scaling(self) -> float:
        """The share of the commanded speed at which the arm really moves."""
        ...

    def measured_joints_rad(self) -> tuple[float, ...]:
        """RTDE `actual_q`."""
        ...

    def write_inputs(self, values: list[tuple[str, Any]]) -> None:
        """Take a client's package of inputs."""
        ...

    def answer(self, line: str) -> str:
        """Return the dashboard's answer to one line."""
        ...

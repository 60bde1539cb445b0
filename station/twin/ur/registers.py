"""The controller's inputs as RTDE clients write them, and the general purpose output registers.

Names and types: RTDE guide, tables "Robot controller inputs" and "Robot controller outputs".
"""

import math
import re
from typing import Any

COUNT = 48
FIELDBUS_COUNT = 24
"""EtherNet/IP and PROFINET claim the lower half of the registers."""

TYPE_CODES: dict[str, str] = {
    "BOOL": "?",
    "UINT8": "B",
    "UINT32": "I",
    "UINT64": "Q",
    "INT32": "i",
    "DOUBLE": "d",
    "VECTOR3D": "3d",
    "VECTOR6D": "6d",
    "VECTOR6INT32": "6i",
    "VECTOR6UINT32": "6I",
}

OTHER_INPUTS: dict[str, str] = {
    "speed_slider_mask": "UINT32",
    "speed_slider_fraction": "DOUBLE",
    "standard_digital_output_mask": "UINT8",
    "standard_digital_output": "UINT8",
    "configurable_digital_output_mask": "UINT8",
    "configurable_digital_output": "UINT8",
    "tool_digital_output_mask": "UINT8",
    "tool_digital_output": "UINT8",
    "standard_analog_output_mask": "UINT8",
    "standard_analog_output_type": "UINT8",
    "standard_analog_output_0": "DOUBLE",
    "standard_analog_output_1": "DOUBLE",
    "input_bit_registers0_to_31": "UINT32",
    "input_bit_registers32_to_63": "UINT32",
    "external_force_torque": "VECTOR6D",
}

_REGISTER = re.compile(r"input_(int|double|bit)_register_(\d{1,3})")


def input_type(name: str) -> str | None:
    """RTDE type of an input; None where there is no such input."""
    if name in OTHER_INPUTS:
        return OTHER_INPUTS[name]
    match = _REGISTER.fullmatch(name)
    if match is None:
        return None
    kind, number = match[1], int(match[2])
    if kind == "bit":
        return "BOOL" if 64 <= number <= 127 else None
    if number >= COUNT:
        return None
    return "INT32" if kind == "int" else "DOUBLE"


class Registers:
    """Values of inputs and output registers, and which client claimed which input."""

    def __init__(self) -> None:
        self.inputs: dict[str, Any] = {}
        self.output_int: list[int] = [0] * COUNT
        self.output_double: list[float] = [0.0] * COUNT
        self.written_at_s: dict[str, float] = {}
        self._owners: dict[str, object] = {}

    def claim(self, name: str, owner: object, *, fieldbus_on: bool) -> bool:
        """Reserve an input for a client; False where another client or the fieldbus has it."""
        if fieldbus_on and _held_by_fieldbus(name):
            return False
        return self._owners.setdefault(name, owner) is owner

    def release(self, owner: object) -> None:
        """Give up all that a client claimed."""
        self._owners = {name: holder for name, holder in self._owners.items() if holder is not owner}

    def write(self, name: str, value: Any, now_s: float) -> None:
        """Take an input from a client."""
        self.inputs[name] = value
        self.written_at_s[name] = now_s

    def input_int(self, number: int) -> int:
        """An integer input register; 0 where it was never written."""
        return self.inputs.get(f"input_int_register_{number}", 0)

    def input_doubles(self, first: int, count: int) -> tuple[float, ...]:
        """Neighbouring double input registers; 0.0 where they were never written.

        Raises:
            ValueError: one of them is not a finite number.
        """
        values = tuple(self.inputs.get(f"input_double_register_{first + i}", 0.0) for i in range(count))
        if not all(map(math.isfinite, values)):
            raise ValueError(f"double input registers {first} to {first + count - 1} hold {values}")
        return values


def _held_by_fieldbus(name: str) -> bool:
    match = _REGISTER.fullmatch(name)
    return match is not None and match[1] != "bit" and int(match[2]) < FIELDBUS_COUNT

"""Digital and analogue outputs of the controller, as RTDE clients set them.

Names, bits and units: RTDE guide, tables "Robot controller inputs" and "Robot controller outputs".
"""

from collections.abc import Mapping
from typing import Any

DIGITAL_GROUPS = {"standard": 0, "configurable": 8, "tool": 16}
"""First bit of each group in `actual_digital_output_bits`."""
_SMALLEST_CURRENT_A, _CURRENT_SPAN_A, _VOLTAGE_SPAN_V = 0.004, 0.016, 10.0


class InputsOutputs:
    """State of the outputs. Inputs are not wired: they read as 0."""

    def __init__(self) -> None:
        self.digital_bits = 0
        self._ratios = [0.0, 0.0]
        self._voltage_bits = 0

    def write(self, written: Mapping[str, Any]) -> None:
        """Set those outputs that a client's masks name, by a package's inputs."""
        for group, first in DIGITAL_GROUPS.items():
            mask = written.get(f"{group}_digital_output_mask", 0) << first
            wanted = written.get(f"{group}_digital_output", 0) << first
            self.digital_bits = (self.digital_bits & ~mask) | (wanted & mask)
        mask = written.get("standard_analog_output_mask", 0)
        self._voltage_bits = (self._voltage_bits & ~mask) | (written.get("standard_analog_output_type", 0) & mask)
        for number in (0, 1):
            if mask >> number & 1:
                ratio = written.get(f"standard_analog_output_{number}", 0.0)
                self._ratios[number] = min(max(0.0, ratio), 1.0)

    @property
    def analog_types(self) -> int:
        """RTDE `analog_io_types`: bits 2 and 3 are the outputs', 1 for voltage; inputs measure currents."""
        return (self._voltage_bits & 3) << 2

    def analog_output(self, number: int) -> float:
        """Value of an analogue output, A or V by its type."""
        if self._voltage_bits >> number & 1:
            return self._ratios[number] * _VOLTAGE_SPAN_V
        return _SMALLEST_CURRENT_A + self._ratios[number] * _CURRENT_SPAN_A

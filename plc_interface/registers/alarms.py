"""Alarm registers: the station's active alarms as registers, and back."""

from collections.abc import Mapping
from typing import Any

from plc_interface.registers.map import BY_NAME

ALARMS = (BY_NAME["alarms"], BY_NAME["alarms_33_to_64"])
"""32 alarms each, in the order of the alarms' numbers."""

_BITS = 32


def alarm_values(active: int) -> dict[str, int]:
    """Return the alarm registers' values by name; bit n of `active` is the alarm with number n + 1."""
    return {register.name: active >> _BITS * place & register.mask for place, register in enumerate(ALARMS)}


def active_alarms(values: Mapping[str, Any]) -> tuple[int, ...]:
    """Return the numbers of the active alarms, ascending, from the alarm registers' values by name."""
    active = sum(int(values[register.name]) << _BITS * place for place, register in enumerate(ALARMS))
    return tuple(place + 1 for place in range(active.bit_length()) if active >> place & 1)

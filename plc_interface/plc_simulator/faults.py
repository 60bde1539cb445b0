"""Injected faults of a PLC's program, for tests of the station."""

from collections.abc import Sequence
from enum import StrEnum


class LineFault(StrEnum):
    """One misbehaviour, injected while one fruit is in the nest."""

    LATE_ACKNOWLEDGE = "late_acknowledge"
    """The result is left waiting for a while."""
    FORGOTTEN_TRIGGER = "forgotten_trigger"
    """The trigger bit stays up until the result is acknowledged."""
    FORGOTTEN_ACKNOWLEDGE = "forgotten_acknowledge"
    """The acknowledge bit stays up until the next fruit is triggered."""
    REPEATED_ID = "repeated_id"
    """A second trigger has the id of the one before."""
    SKIPPED_ID = "skipped_id"
    """Ids are left out."""
    FROZEN_HEARTBEAT = "frozen_heartbeat"
    """The PLC's heartbeat stops until the station has noticed."""
    SWAPPED_WORDS = "swapped_words"
    """The sequence is first acknowledged in the other word order."""
    RECONNECT = "reconnect"
    """The connection is cut and made again while the fruit is inspected."""


class FaultPlan:
    """Schedule of faults: every n-th fruit has one, in turn, in this order; none if there are none."""

    def __init__(self, faults: Sequence[LineFault] = (), every: int = 3) -> None:
        self._faults, self._every = tuple(faults), every

    def of_fruit(self, number: int) -> LineFault | None:
        """Return the fault of a fruit, counted from 1."""
        turn, rest = divmod(number, self._every)
        return self._faults[(turn - 1) % len(self._faults)] if self._faults and rest == 0 else None

"""What the processes log: JSON lines for machines, or lines for a person at a terminal."""

from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import Literal, TextIO

from station.channel.line import Outcome


def configure_logging(
    process: str, style: Literal["auto", "json", "human"] = "auto", level: str = "INFO", stream: TextIO | None = None
) -> None:
    """Send every log record of this process, structlog's and the standard library's, to one stream. Idempotent.

    Args:
        process: this process's name, in every line.
        style: `auto` is human on a terminal, JSON elsewhere.
        level: the least that is logged.
        stream: standard error by default.
    """
    raise NotImplementedError


def inspecting(sequence: int) -> AbstractContextManager[None]:
    """Put the inspection's sequence into every line logged inside, also by tasks begun inside."""
    raise NotImplementedError


def fruit_line(outcome: Outcome, fruit: str, explanation: Sequence[str], areas_mm2: Sequence[float | None]) -> str:
    """One fruit in one line that a person reads: sequence, fruit, curve as a sparkline, outcome, why, time."""
    raise NotImplementedError

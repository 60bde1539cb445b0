"""Log line of one fruit, for people who follow the log."""

import logging
from collections.abc import Sequence

from station.channel.line import Outcome
from station.messages.message import Message, joined
from station.records.texts import sparkline


def log_fruit(
    log: logging.Logger,
    outcome: Outcome,
    fruit: str,
    explanation: Sequence[Message],
    areas_mm2: Sequence[float | None],
) -> None:
    """Log one fruit in one line: sequence, recipe's name, curve as a sparkline, outcome, time, explanation."""
    area = "no area" if outcome.area_mm2 is None else f"{outcome.area_mm2:.1f} mm²"
    if outcome.closing_mm is not None:
        area = f"{area} at {outcome.closing_mm:.1f} mm"
    parts = [
        f"fruit {outcome.sequence}",
        f"trigger {outcome.trigger_id}",
        fruit or "no recipe",
        sparkline(areas_mm2) or "-",
        outcome.outcome,
        area,
        f"{outcome.duration_ms / 1000:.2f} s",
    ]
    line = "  ".join([*parts, *(["late"] if outcome.late else [])])
    why = joined(explanation) if explanation else ", ".join(outcome.reasons)
    log.info("%s  %s" if why else "%s%s", line, why)

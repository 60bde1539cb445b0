"""What the processes log: JSON lines for machines, or lines for a person at a terminal."""

import logging
import re
import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import Any, Literal, TextIO

import structlog
from structlog.typing import EventDict, Processor

from station.channel.line import Outcome
from station.records.wording import sparkline

_SECRET = re.compile(
    r"password|passwd|secret|token|api_?key|private_?key|credential|authorization|\bpin\b", re.IGNORECASE
)
HIDDEN = "(hidden)"


def configure_logging(
    process: str, style: Literal["auto", "json", "human"] = "auto", level: str = "INFO", stream: TextIO | None = None
) -> None:
    """Send every log record of this process, structlog's and the standard library's, to one stream. Idempotent.

    A line has `event`, `level`, `logger`, `time` (UTC), `process`, what was bound, as `sequence`, and what was given.
    The values of fields that are named like secrets are hidden.

    Args:
        process: this process's name, in every line.
        style: `auto` is human on a terminal, JSON elsewhere.
        level: the least that is logged.
        stream: standard error by default.
    """
    output: TextIO = stream or sys.stderr
    terminal = output.isatty()
    human = style == "human" or (style == "auto" and terminal)

    def name_process(_logger: Any, _method: str, event: EventDict) -> EventDict:
        return {**event, "process": process}

    shared: list[Processor] = [
        structlog.contextvars.merge_contextvars,
        structlog.stdlib.add_log_level,
        structlog.stdlib.add_logger_name,
        structlog.stdlib.PositionalArgumentsFormatter(),
        structlog.processors.TimeStamper("iso", utc=True, key="time"),
        name_process,
        _hide_secrets,
        structlog.processors.StackInfoRenderer(),
    ]
    render: Processor = structlog.processors.JSONRenderer(ensure_ascii=False, default=str)
    if human:
        render = structlog.dev.ConsoleRenderer(colors=terminal, timestamp_key="time", pad_event_to=0)
    handler = logging.StreamHandler(output)
    handler.setFormatter(
        structlog.stdlib.ProcessorFormatter(
            foreign_pre_chain=[*shared, structlog.stdlib.ExtraAdder()],
            processors=[
                structlog.stdlib.ProcessorFormatter.remove_processors_meta,
                _hide_secrets,
                structlog.processors.format_exc_info,  # without local variables, which may be secrets
                render,
            ],
        )
    )
    root = logging.getLogger()
    for old in [old for old in root.handlers if getattr(old, "of_the_station", False)]:
        root.removeHandler(old)
    handler.of_the_station = True  # type: ignore[attr-defined]
    root.addHandler(handler)
    root.setLevel(level)
    for chatty in ("alembic", "uvicorn"):
        logging.getLogger(chatty).setLevel(logging.WARNING)
    structlog.configure(
        processors=[
            structlog.stdlib.filter_by_level,
            *shared,
            structlog.stdlib.ProcessorFormatter.wrap_for_formatter,
        ],
        logger_factory=structlog.stdlib.LoggerFactory(),
        wrapper_class=structlog.stdlib.BoundLogger,
        cache_logger_on_first_use=False,
    )


def inspecting(sequence: int) -> AbstractContextManager[None]:
    """Put the inspection's sequence into every line logged inside, also by tasks begun inside."""
    return structlog.contextvars.bound_contextvars(sequence=sequence)


def fruit_line(outcome: Outcome, fruit: str, explanation: Sequence[str], areas_mm2: Sequence[float | None]) -> str:
    """One fruit in one line that a person reads: sequence, fruit, curve as a sparkline, outcome, why, time.

    Args:
        outcome: what the PLC is told.
        fruit: the recipe's name.
        explanation: why, in sentences.
        areas_mm2: the curve, step by step.
    """
    area = "no area" if outcome.area_mm2 is None else f"{outcome.area_mm2:.1f} mm²"
    if outcome.closing_mm is not None:
        area = f"{area} at {outcome.closing_mm:.1f} mm"
    why = "; ".join(explanation) or ", ".join(outcome.reasons)
    parts = [
        f"fruit {outcome.sequence}",
        f"trigger {outcome.trigger_id}",
        fruit or "no recipe",
        sparkline(areas_mm2) or "-",
        outcome.outcome,
        area,
        f"{outcome.duration_ms / 1000:.2f} s",
    ]
    return "  ".join([*parts, *(["late"] if outcome.late else []), *([why] if why else [])])


def _hide_secrets(_logger: Any, _method: str, event: EventDict) -> EventDict:
    return {name: HIDDEN if _SECRET.search(name) else value for name, value in event.items()}

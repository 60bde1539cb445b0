"""Logging of the processes: JSON lines for machines, or text lines for a person at a terminal."""

import logging
import re
import sys
from collections.abc import Mapping
from contextlib import AbstractContextManager
from typing import Any, Literal, TextIO

import structlog
from structlog.typing import EventDict, Processor

from station.errors import StationError
from station.messages.message import Message, joined

_SECRET = re.compile(
    r"password|passwd|secret|token|api_?key|private_?key|credential|authorization|\bpin\b", re.IGNORECASE
)
HIDDEN = "(hidden)"
# The PLC interface logs a fieldbus library's events itself.
_LIBRARIES = {
    "alembic": logging.WARNING,
    "uvicorn": logging.WARNING,
    "pymodbus": logging.CRITICAL,
    "can": logging.CRITICAL,
    "canopen": logging.CRITICAL,
}


def configure_logging(
    process: str, style: Literal["auto", "json", "human"] = "auto", level: str = "INFO", stream: TextIO | None = None
) -> None:
    """Send every log record of this process, structlog's and the standard library's, to one stream. Idempotent.

    A line has `event`, `level`, `logger`, `time` (UTC), `process`, what was bound, as `sequence`, and what was given.
    The values of fields that are named like secrets are hidden. A `Message` or a station's error, given as an argument
    or as a field, reads as its English sentence; a JSON line also has its id and its parameters, as `message` and
    `parameters`.

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
    named: list[Processor] = [] if human else [_name_messages]
    render: Processor = structlog.processors.JSONRenderer(ensure_ascii=False, default=str)
    if human:
        render = structlog.dev.ConsoleRenderer(colors=terminal, timestamp_key="time", pad_event_to=0)
    handler = logging.StreamHandler(output)
    handler.setFormatter(
        structlog.stdlib.ProcessorFormatter(
            foreign_pre_chain=[structlog.stdlib.ExtraAdder(), *named, _drop_arguments, *shared],
            pass_foreign_args=True,
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
    handler.of_the_station = True  # pyrefly: ignore[missing-attribute] (our mark)
    root.addHandler(handler)
    root.setLevel(level)
    for name, least in _LIBRARIES.items():
        logging.getLogger(name).setLevel(least)
    structlog.configure(
        processors=[
            structlog.stdlib.filter_by_level,
            *named,
            *shared,
            structlog.stdlib.ProcessorFormatter.wrap_for_formatter,
        ],
        logger_factory=structlog.stdlib.LoggerFactory(),
        wrapper_class=structlog.stdlib.BoundLogger,
        cache_logger_on_first_use=False,
    )


def inspecting(sequence: int) -> AbstractContextManager[None]:
    """Put the inspection's sequence into every line logged inside, also by tasks started inside."""
    return structlog.contextvars.bound_contextvars(sequence=sequence)


def _name_messages(_logger: Any, _method: str, event: EventDict) -> EventDict:
    """Add the id and the parameters of the messages that were given; several are listed as one."""
    arguments = event.get("positional_args") or ()
    values = arguments.values() if isinstance(arguments, Mapping) else arguments
    given = [said for value in (*values, *event.values()) if (said := _message_in(value)) is not None]
    if not given:
        return event
    said = joined(given)
    written = {name: value if _message_in(value) is None else str(value) for name, value in event.items()}
    return {**written, "message": said.id, "parameters": said.model_dump(mode="json")["parameters"]}


def _message_in(value: object) -> Message | None:
    said = value.message if isinstance(value, StationError) else value
    return said if isinstance(said, Message) else None


def _drop_arguments(_logger: Any, _method: str, event: EventDict) -> EventDict:
    # A foreign record's event is written out already, and may have percent signs of its own.
    return {name: value for name, value in event.items() if name != "positional_args"}


def _hide_secrets(_logger: Any, _method: str, event: EventDict) -> EventDict:
    return {name: HIDDEN if _SECRET.search(name) else value for name, value in event.items()}

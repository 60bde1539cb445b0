"""Ring buffer of this process's log, for the maintenance page."""

import logging
from collections import deque
from typing import Any, Self

from station.channel.panel_maintenance_queries import LogLine

STORED_LINES = 1000
_LONGEST = 1000


class LogRing(logging.Handler):
    """Log handler that stores the newest lines; it is attached inside `with`."""

    def __init__(self) -> None:
        super().__init__()
        self._lines: deque[LogLine] = deque(maxlen=STORED_LINES)
        self._numbers: deque[int] = deque(maxlen=STORED_LINES)

    def __enter__(self) -> Self:
        logging.getLogger().addHandler(self)
        return self

    def __exit__(self, *_: object) -> None:
        logging.getLogger().removeHandler(self)
        self.close()

    def emit(self, record: logging.LogRecord) -> None:
        """Store a line."""
        line = LogLine(
            utc_ms=round(1000 * record.created), level=record.levelname, logger=record.name, text=_text(record)
        )
        self._lines.append(line)
        self._numbers.append(record.levelno)

    def last(self, number: int, level: str) -> tuple[LogLine, ...]:
        """Return the newest lines of a lowest level, by its name, newest last."""
        least = logging.getLevelNamesMapping()[level]
        chosen = [line for line, found in zip(self._lines, self._numbers, strict=True) if found >= least]
        return tuple(chosen[-number:])


def _text(record: logging.LogRecord) -> str:
    told: Any = record.msg
    text = str(told.get("event", "")) if isinstance(told, dict) else record.getMessage()
    if record.exc_info and record.exc_info[1] is not None:
        text = f"{text}: {type(record.exc_info[1]).__name__}: {record.exc_info[1]}"
    return text[:_LONGEST]

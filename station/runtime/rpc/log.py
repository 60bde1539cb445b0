"""Ring buffer of this process's log, for the maintenance page."""

import logging
from collections import deque
from typing import Any, NamedTuple, Self

from station.channel.panel_maintenance import LogLine

STORED_LINES = 1000
"""Lines in memory: an estimate."""
_LONGEST = 1000
"""Characters of a line at most: an estimate."""


class _Stored(NamedTuple):
    """A line, in less than half of the memory that its message takes."""

    level: int
    utc_ms: int
    logger: str
    text: str


class LogRing(logging.Handler):
    """Log handler that stores the newest lines; it is attached inside `with`."""

    def __init__(self) -> None:
        super().__init__()
        self._lines: deque[_Stored] = deque(maxlen=STORED_LINES)

    def __enter__(self) -> Self:
        logging.getLogger().addHandler(self)
        return self

    def __exit__(self, *_: object) -> None:
        logging.getLogger().removeHandler(self)
        self.close()

    def emit(self, record: logging.LogRecord) -> None:
        """Store a line."""
        self._lines.append(_Stored(record.levelno, round(1000 * record.created), record.name, _text(record)))

    def last(self, number: int, level: str) -> tuple[LogLine, ...]:
        """Return the newest lines of a lowest level, by its name, newest last."""
        least = logging.getLevelNamesMapping()[level]
        chosen = [line for line in self._lines if line.level >= least]
        return tuple(
            LogLine(utc_ms=line.utc_ms, level=logging.getLevelName(line.level), logger=line.logger, text=line.text)
            for line in chosen[-number:]
        )


def _text(record: logging.LogRecord) -> str:
    message: Any = record.msg
    text = str(message.get("event", "")) if isinstance(message, dict) else record.getMessage()
    if record.exc_info and record.exc_info[1] is not None:
        text = f"{text}: {type(record.exc_info[1]).__name__}: {record.exc_info[1]}"
    return text[:_LONGEST]

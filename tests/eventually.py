"""Polling with a deadline: `eventually` blocks, `until` is awaited; a failure names what was waited for."""

import asyncio
import inspect
import linecache
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

PATIENCE_S = 60.0


def eventually(what: Callable[[], Any], patience_s: float = PATIENCE_S, *, of: object = None) -> Any:
    """Poll until something is true, and return it.

    Args:
        what: is called again and again.
        patience_s: for how long.
        of: is named in the place of `what`, where that only calls it.
    """
    deadline_s = time.monotonic() + patience_s
    while not (value := what()):
        assert time.monotonic() < deadline_s, _not_so(of or what, patience_s)
        time.sleep(0.05)
    return value


async def until(what: Callable[[], Any], patience_s: float = PATIENCE_S) -> Any:
    """Poll as `eventually` does, in an event loop; where `what` gives an awaitable, its result counts."""
    deadline = asyncio.timeout(patience_s)
    try:
        async with deadline:
            while True:
                value = what()
                if inspect.isawaitable(value):
                    value = await value
                if value:
                    return value
                await asyncio.sleep(0.01)
    except TimeoutError as error:
        if not deadline.expired():
            raise
        raise AssertionError(_not_so(what, patience_s)) from error


def _not_so(what: object, patience_s: float) -> str:
    """The line on which a function or lambda begins, and its place."""
    code = getattr(what, "__code__", None)
    if code is None:
        return f"not so within {patience_s} s: {what}"
    line = linecache.getline(code.co_filename, code.co_firstlineno).strip()
    return f"not so within {patience_s} s: {line} ({Path(code.co_filename).name}:{code.co_firstlineno})"

"""Signals that end a command: Ctrl-C, the end of a service, and the end of a terminal."""

import asyncio
import signal
from collections.abc import Callable


def on_end_signals(action: Callable[[], object]) -> None:
    """Call an action in the running event loop at each signal that ends a program."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        asyncio.get_running_loop().add_signal_handler(number, action)

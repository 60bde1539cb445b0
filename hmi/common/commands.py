"""Operator commands on the pages: which one is shown, and how long."""

from collections.abc import Sequence

from station.channel.panel_run import OperatorCommandView

_FAILED_SHOWN_MS = 60_000


def shown_command(commands: Sequence[OperatorCommandView], now_utc_ms: int) -> OperatorCommandView | None:
    """Return the newest command if it failed, for a minute: by then it has been read; else one in progress, if any.

    Args:
        commands: newest first.
    """
    newest = commands[0] if commands else None
    if newest is not None and newest.state == "failed" and now_utc_ms - (newest.ended_utc_ms or 0) <= _FAILED_SHOWN_MS:
        return newest
    return next((each for each in commands if each.state == "executing"), None)

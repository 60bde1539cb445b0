"""Everything the station can say; one module for each room that says it. Importing the package defines all of it."""

from station.messages import (
    alarms,
    calibration,
    can,
    channel,
    commands,
    jobs,
    line,
    lots,
    maintenance,
    message,
    operation,
    outbox,
    readiness,
    states,
)

__all__ = [
    "alarms",
    "calibration",
    "can",
    "channel",
    "commands",
    "jobs",
    "line",
    "lots",
    "maintenance",
    "message",
    "operation",
    "outbox",
    "readiness",
    "states",
]

"""Start commands of the station's processes."""

import sys
from dataclasses import replace
from pathlib import Path

from station.settings.service import ServiceSettings
from station.supervision.supervisor import Program

_CLEAN_UP_S = ServiceSettings().clean_up_deadline_s
_CLOSING_S = 10.0
"""The service's time to close devices and records after its clean-up: an estimate."""


def station_programs(
    config: Path | None, logs: Path | None = None, *, outbox: bool = False, clean_up_s: float = _CLEAN_UP_S
) -> list[Program]:
    """Return the processes of one station: the service, the PLC interface, which outlives it, and the pages.

    Args:
        config: the configuration's file; None for the usual one.
        logs: the folder of their logs; None for the supervisor's own output.
        clean_up_s: the configuration's `service.clean_up_deadline_s`.
    """
    service = _program("service", logs, "service", *_config(config))
    programs = [
        replace(service, stop_limit_s=clean_up_s + _CLOSING_S),
        # The PLC reads the outcome of the inspection that the service's end has ended.
        replace(_program("plc", logs, "plc", "run", *_config(config)), outlives="service"),
        _program("hmi", logs, "hmi", *_config(config)),
    ]
    return [*programs, _program("outbox", logs, "outbox", "run", *_config(config))] if outbox else programs


def twin_program(config: Path | None, console_port: int, seed: int, logs: Path | None = None) -> Program:
    """Return the process of the simulated world, which replaces the devices, with a seed of the sensor's noise."""
    options = ("--console", str(console_port), "--seed", str(seed))
    return _program("twin", logs, "twin", *_config(config), *options)


def _config(config: Path | None) -> tuple[str, ...]:
    return ("--config", str(config)) if config else ()


def _program(name: str, logs: Path | None, *arguments: str) -> Program:
    # -P: a folder `station` in the working directory is not this program.
    command = (sys.executable, "-P", "-m", "station", *arguments)
    return Program(name, command, output=logs / f"{name}.log" if logs else None)

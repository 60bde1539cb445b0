"""Start commands of the station's processes."""

import sys
from pathlib import Path

from station.supervision.supervisor import Program


def station_programs(config: Path | None, logs: Path | None = None, *, outbox: bool = False) -> list[Program]:
    """Return the processes of one station: the service, the PLC interface, which outlives it, and the pages.

    Args:
        config: the configuration's file; None for the usual one.
        logs: the folder of their logs; None for the supervisor's own output.
    """
    programs = [
        _program("service", logs, "service", *_config(config)),
        _program("plc", logs, "plc", "run", *_config(config)),
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

"""`station plc`: the interface to the line's PLC."""

import asyncio
from pathlib import Path

import click

from plc_interface.outputs.can.command import check_can
from plc_interface.process.process import serve
from plc_interface.registers.generate.files import DOCUMENTS, drifted_files, write_files
from station.config_option import config_option
from station.errors import StationError
from station.logs import configure_logging
from station.settings.last_good import load_or_last_good


@click.group("plc")
def plc() -> None:
    """Serve the PLC interface, and export its documents."""


plc.add_command(check_can)


@plc.command("run")
@config_option
def run(config: Path | None) -> None:
    """Serve the line's PLC until Ctrl-C: registers, handshake, and the reject gate where CAN is enabled.

    The station may start and stop meanwhile: while it does not answer, the PLC reads that and its triggers are refused.
    """
    configure_logging("plc")
    site, _ = load_or_last_good(config)
    asyncio.run(serve(site))


@plc.command("docs")
@click.option("--out", type=click.Path(path_type=Path), default=DOCUMENTS, metavar="DIR", show_default="docs/plc")
@click.option("--check", is_flag=True, help="Write nothing; exit code 1 where a file is not what would be made.")
def docs(out: Path, check: bool) -> None:  # noqa: FBT001 (click passes arguments by name)
    """Make the register map's documents, import files for other tools, and the PLC's code."""
    if not check:
        written = write_files(out)
        for path in written:
            click.echo(f"wrote {path}")
        if not written:
            click.echo(f"nothing to write: {out} is up to date with the register map")
        return
    drifted = drifted_files(out)
    if drifted:
        names = ", ".join(str(path) for path in drifted)
        raise StationError(f"differs from the register map: {names}; run `station plc docs`")
    click.echo(f"{out} is up to date with the register map")

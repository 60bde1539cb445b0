"""Command `station`: a table of commands, each imported only when it is used."""

import errno
import gc
import importlib
import os
import sys
from importlib.metadata import version
from typing import NamedTuple, NoReturn

import click

from station.errors import StationError


class Entry(NamedTuple):
    """Place of a command, as `module:attribute`, and its one line in `station --help`."""

    target: str
    summary: str


COMMANDS = {
    "administrator": Entry("hmi.people.command:administrator", "Make the first person who may log in."),
    "alarms": Entry("station.commands.alarms:alarms", "See, acknowledge and shelve the station's alarms."),
    "analyze": Entry("station.commands.analyze:analyze_command", "Measure the deformed area in tactile images."),
    "api-token": Entry("hmi.api.command:api_token", "Make and withdraw tokens for the HTTP API."),
    "audit": Entry("station.commands.audit:audit", "Show who changed or commanded what, and verify the trail."),
    "calibrate": Entry("station.commands.calibrate:calibrate", "Calibrate the sensor with a ball of known size."),
    "config": Entry("station.commands.config:config", "Show, check and migrate the configuration."),
    "demo": Entry("station.commands.demo:demo", "Run the station against a simulated world and line."),
    "devices": Entry("station.commands.devices:devices", "Check the station's devices."),
    "grip": Entry("station.commands.grip:grip", "Grip one fruit and write its frames and widths."),
    "grr": Entry("station.commands.grr:grr", "Analyse how far measurements repeat: a gauge study."),
    "hmi": Entry("hmi.web.command:hmi", "Serve the operators' pages."),
    "line": Entry("plc_interface.plc_simulator.command:line", "Simulate the line's PLC."),
    "outbox": Entry("station.commands.outbox:outbox", "Publish inspections to other systems, or show the delay."),
    "plc": Entry("plc_interface.process.command:plc", "Serve the PLC interface, and export its documents."),
    "recipes": Entry("station.commands.recipes:recipes", "Manage recipes, their revisions and approvals."),
    "records": Entry("station.commands.records:records", "Query inspections and their explanations."),
    "run": Entry("station.commands.run:run", "Run the station: all its processes, supervised."),
    "service": Entry("station.commands.service:service", "Inspect fruit at the PLC's triggers."),
    "study": Entry("station.commands.study:study", "Repeat the paper's experiments on the simulated world."),
    "support": Entry("station.commands.support:support", "Write a support bundle, without secrets."),
    "thresholds": Entry("station.commands.thresholds:thresholds", "Propose damage thresholds from marked fruit."),
    "twin": Entry("station.twin.command:twin", "Run the simulated world, or draw from it."),
    "verify": Entry("station.commands.verify:verify", "Verify the sensor with the ball, at the start of a shift."),
    "whatif": Entry("station.commands.whatif:whatif", "Judge stored inspections again by a draft of a recipe."),
}


class LazyGroup(click.Group):
    """A group that imports a command's module only to run it or to show its help."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names in the table's order."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import and return the command, or None if the table has no such name."""
        if cmd_name not in COMMANDS:
            return None
        module, attribute = COMMANDS[cmd_name].target.split(":")
        if module not in sys.modules:
            _import_uncollected(module)
        return getattr(sys.modules[module], attribute)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of commands without importing any of them."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, entry.summary) for name, entry in COMMANDS.items()])


def _import_uncollected(module: str) -> None:
    """Import a module and all it needs, none of which is garbage: a search for some would take a third of the time."""
    gc.disable()
    try:
        importlib.import_module(module)
    finally:
        gc.freeze()
        gc.enable()


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(version("fruit-station"), prog_name="station")
def cli() -> None:
    """Inspect soft fruit with a gripper and an opto-tactile sensor."""


def main() -> NoReturn:
    """Run the command line: exit code 0 on success, 2 on bad usage or bad input, 1 on a failure.

    What it writes is for the user and the group alone, also outside the services' unit, which sets the same.
    """
    os.umask(os.umask(0o027) | 0o027)
    try:
        code = cli.main(standalone_mode=False)
    except click.ClickException as error:
        error.show()
        code = error.exit_code
    except click.Abort:
        click.echo("station: interrupted", err=True)
        code = 130
    except StationError as error:
        click.echo(f"station: {error}", err=True)
        code = error.exit_code
    except BrokenPipeError:
        sys.stderr.close()
        code = 1
    except OSError as error:
        if error.errno == errno.ENOSPC:
            click.echo(f"station: {error.strerror}; free space where the output goes", err=True)
            os._exit(1)  # standard output cannot be flushed: the interpreter would complain of it on its way out
        if error.filename is None:
            raise
        click.echo(f"station: {error.filename}: {error.strerror}", err=True)
        code = 1
    raise SystemExit(code if isinstance(code, int) else 0)

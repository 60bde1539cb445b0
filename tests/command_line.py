"""The station's command line, run in this process."""

from click.testing import CliRunner

from station.cli import cli
from station.errors import StationError


def call(*arguments: object) -> tuple[int, str]:
    """Run a command; return its exit code and its output, or the refusal's text alone."""
    done = CliRunner().invoke(cli, [str(argument) for argument in arguments])
    if isinstance(done.exception, StationError):
        return done.exception.exit_code, str(done.exception)
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    return done.exit_code, done.output

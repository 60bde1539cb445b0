"""Programs that tests run beside the project's own."""

import os
import shutil
from typing import NoReturn

import pytest


def missing(what: str) -> NoReturn:
    """Skip a test for want of what `run` installs; fail it where CI promises that nothing is missing."""
    if os.environ.get("CI") == "true":
        pytest.fail(f"{what} is missing, which is an error where CI=true", pytrace=False)
    pytest.skip(f"{what} is missing on this machine")


def required(program: str) -> str:
    """Return the path of a program that `run` installs, or that comes with what it installs; else see `missing`."""
    return shutil.which(program) or missing(program)


def optional(program: str) -> str:
    """Return the path of a program that `run` does not install, as systemd's; skip the test for want of it, in CI too.

    A machine of CI may have no systemd, Node.js, Go or Java.
    """
    return shutil.which(program) or pytest.skip(f"{program} is missing on this machine")

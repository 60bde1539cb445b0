"""pytest plugin: each test several times over, with the number of the time in its name."""

import re

import pytest

_OF_TIME = re.compile(r"(?:(?<=\[)time(\d+)-?|-time(\d+)(?=[-\]]))")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the number of times."""
    parser.addoption("--times", type=int, default=1, help="run each test so many times")


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Make a test of each time."""
    metafunc.fixturenames.append("time_number")
    metafunc.parametrize("time_number", range(metafunc.config.getoption("--times")), ids="time{}".format)


def split(name: str) -> tuple[str, int]:
    """Return a test's own name, and which of its times it was, from 0.

    Raises:
        ValueError: this plugin did not make it.
    """
    found = _OF_TIME.search(name)
    if found is None:
        raise ValueError(f"{name} is not one of several times")
    return (name[: found.start()] + name[found.end() :]).removesuffix("[]"), int(found[1] or found[2])

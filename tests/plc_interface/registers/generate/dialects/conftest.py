"""Parsers of two vendors' languages, by grammars written after their manuals."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from lark import Lark

from tests.plc_interface.registers.generate.structured_text.conftest import Plc

HERE = Path(__file__).parent


def parser(dialect: str) -> Lark:
    grammar = "\n".join((HERE / f"{name}.lark").read_text() for name in (dialect, "statements"))
    return Lark(grammar, parser="lalr", maybe_placeholders=True)


@pytest.fixture(scope="session")
def scl() -> Callable[[str], Any]:
    return parser("scl").parse


@pytest.fixture(scope="session")
def logix_parser() -> Lark:
    return parser("logix")


@pytest.fixture(scope="session")
def logix(logix_parser: Lark) -> Callable[[str], Any]:
    return logix_parser.parse


@pytest.fixture
def make_plc() -> Callable[..., Plc]:
    return Plc

"""Plain scalars of a YAML file: the YAML 1.2 core schema, where YAML 1.1 agrees with it.

Source: YAML 1.2.2, section 10.3.2 (core schema); YAML 1.1 as PyYAML resolves it. A word that the two read differently
(`NO`, `012`, `1e3`, `1:30`, `1_000`, a date) is refused: its author cannot predict the next reader's result.
"""

import math
import re

import yaml
from yaml.resolver import Resolver

from station.settings.problems import shortened

LONGEST_NUMBER = 40
"""Characters of a number; more cannot be meant, and converting thousands of digits takes time."""
LARGEST_INTEGER = 10**18

Scalar = str | int | float | bool | None

_CORE: tuple[tuple[str, re.Pattern[str]], ...] = (
    ("null", re.compile(r"null|Null|NULL|~|")),
    ("bool", re.compile(r"true|True|TRUE|false|False|FALSE")),
    ("int", re.compile(r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+")),
    ("float", re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")),
)
_LEADING_ZERO = re.compile(r"[-+]?0[0-9_]+")
_YAML_1_1 = Resolver()


class MeaningError(ValueError):
    """A word without one finite meaning; its text states what was expected."""


def plain_scalar(text: str) -> Scalar:
    """Parse an unquoted word.

    Args:
        text: as in the file.

    Raises:
        MeaningError: YAML 1.1 and 1.2 read it differently, or it is not finite, or absurdly large.
    """
    kind = next((name for name, pattern in _CORE if pattern.fullmatch(text)), "str")
    old_kind = _YAML_1_1.resolve(yaml.ScalarNode, text, (True, False)).rpartition(":")[2]
    if kind != old_kind or (kind == "int" and _LEADING_ZERO.fullmatch(text)):
        raise MeaningError(_ambiguous(text, kind, old_kind))
    if kind == "null":
        return None
    if kind == "bool":
        return text.lower() == "true"
    return text if kind == "str" else _number(text, kind)


def _number(text: str, kind: str) -> int | float:
    """Return a number in the accepted range."""
    if len(text) > LONGEST_NUMBER:
        raise MeaningError(f"expected a number of at most {LONGEST_NUMBER} characters, got {len(text)}")
    if kind == "int":
        integer = int(text, 0)
        if abs(integer) > LARGEST_INTEGER:
            raise MeaningError(f"expected a number of at most 18 digits, got {text}")
        return integer
    number = float(text.lower().replace(".inf", "inf").replace(".nan", "nan"))
    if not math.isfinite(number):
        raise MeaningError(f"expected a finite number, got {text}")
    return number


def _ambiguous(text: str, kind: str, old_kind: str) -> str:
    """Describe a word with two meanings, and the unambiguous forms."""
    shown = shortened(text, 40)
    quoted = f'"{shown}" in quotes for a text'
    if old_kind == "timestamp":
        remedy = f"write {quoted}"
    elif old_kind == "bool":
        remedy = f"write true or false, or {quoted}"
    elif _LEADING_ZERO.fullmatch(text):
        remedy = f"write it without the leading zero, or {quoted}"
    elif kind == "float" and len(text) <= LONGEST_NUMBER and math.isfinite(float(text)):
        remedy = f"write the number without an exponent, or {quoted}"
    else:
        remedy = f"write a number in plain decimal digits, or {quoted}"
    return f"expected a value that YAML 1.1 and 1.2 read alike, got {shown}: {remedy}"

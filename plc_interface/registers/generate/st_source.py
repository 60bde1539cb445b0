"""The function block's Structured Text in parts, from which the dialects of single vendors are made."""

import re
from typing import NamedTuple

_SECTION = re.compile(r"^VAR(_INPUT|_OUTPUT| CONSTANT|)\n(.*?)^END_VAR\n", re.MULTILINE | re.DOTALL)
_ROW = re.compile(r"^    (\w+) : (.+?)(?: := (.+?))?;(?: \(\* (.*) \*\))?$", re.MULTILINE)


class Variable(NamedTuple):
    """A declared variable."""

    section: str
    """`VAR`, `VAR_INPUT`, `VAR_OUTPUT` or `VAR CONSTANT`."""
    name: str
    kind: str
    initial: str
    """Empty where none is given."""
    comment: str


class Source(NamedTuple):
    """A function block in parts."""

    variables: tuple[Variable, ...]
    body: str
    """Its statements."""
    comment: str
    """What it is for, from its head."""


def parts(text: str) -> Source:
    """Return the declarations and statements of a function block in IEC 61131-3 Structured Text."""
    sections = list(_SECTION.finditer(text))
    variables = tuple(
        Variable(f"VAR{section[1]}", *(value or "" for value in row.groups()))
        for section in sections
        for row in _ROW.finditer(section[2])
    )
    body = text[sections[-1].end() :].removesuffix("END_FUNCTION_BLOCK\n").strip("\n")
    head = text[: sections[0].start()].rpartition("(*")[2].partition("*)")[0]
    return Source(variables, body, " ".join(head.split()))

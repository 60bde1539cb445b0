"""Glossary: its names are in the code, its terms are defined once, and each guide links to it."""

import re
from itertools import chain

import pytest

from plc_interface.registers.map import REGISTERS
from station.settings.configuration import Configuration
from station.settings.recipe_model import Recipe
from station.settings.schema import leaves, schema_of

GUIDES = (
    "operator",
    "quality",
    "plc/index",
    "commissioning",
    "maintenance",
    "researcher",
    "developer",
    "index",
    "operator.de",
    "operator.es",
)
DEFINITION = re.compile(r"^\s*(?:class|(?:async )?def) (\w+)", re.MULTILINE)
PACKAGES = ("station", "plc_interface", "hmi", "deploy")


@pytest.fixture(scope="module")
def rows(pages):
    """Cells of every table row of the glossary, its heading rows left out."""
    lines = [line for line in pages["docs/glossary.md"].path.read_text("utf-8").splitlines() if line.startswith("| ")]
    found = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return [row for row in found if row[0] not in {"term", "name"}]


@pytest.fixture(scope="module")
def names(root):
    """Classes and functions, registers and their bits, settings and their sections."""
    sources = chain.from_iterable((root / package).rglob("*.py") for package in PACKAGES)
    defined = {name for source in sources for name in DEFINITION.findall(source.read_text("utf-8"))}
    paths = [leaf.path for model in (Recipe, Configuration) for leaf in leaves(schema_of(model), into_lists=True)]
    settings = {".".join(map(str, path[:end])).replace("[]", "") for path in paths for end in range(1, len(path) + 1)}
    bits = {flag.name for register in REGISTERS for flag in register.bits}
    return defined | settings | bits | {register.name for register in REGISTERS}


def missing(cell, names, root):
    """Names of a cell that are in no code."""
    return [
        name
        for name in re.findall(r"`([^`]+)`", cell)
        if not ((root / name).exists() if "/" in name else name in names)
    ]


def test_every_name_of_the_glossary_is_in_the_code(rows, names, root):
    cells = [row[2] if len(row) == 4 else row[0] for row in rows]
    assert [each for cell in cells for each in missing(cell, names, root)] == []
    assert sum(cell.count("`") for cell in cells) > 100


@pytest.mark.parametrize("name", ["Crumble", "station/no_such.py", "result_colour", "damage.colour"])
def test_a_name_that_is_nowhere_is_found(name, names, root):
    assert missing(f"`Press`, `{name}`", names, root) == [name]


def test_a_term_is_defined_once_and_a_published_name_has_one(rows):
    terms = [term for row in rows if len(row) == 4 for term in row[0].split(", ")]
    assert sorted(terms) == sorted(set(terms))
    assert [row for row in rows if len(row) == 2 and row[1] not in terms] == []


def test_every_guide_links_to_the_glossary(pages):
    without = [
        guide for guide in GUIDES
        if not any(target.endswith("glossary.md") for _, target in pages[f"docs/{guide}.md"].links)
    ]  # fmt: skip
    assert without == []

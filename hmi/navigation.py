"""Navigation: the list of pages in their order. A new page is one more line here."""

import importlib
from collections.abc import Mapping
from functools import cache
from types import ModuleType
from typing import NamedTuple

from hmi.live import Part

PAGES = (
    "hmi.pages.layout",
    "hmi.pages.run",
    "hmi.pages.change",
    "hmi.pages.recipes",
    "hmi.pages.history",
    "hmi.pages.alarms",
    "hmi.pages.maintenance",
    "hmi.pages.people",
    "hmi.pages.jobs",
    "hmi.api",
)
"""Modules with `router`; where they have them, `ENTRY`, their place in the navigation, and `PARTS`."""


class Entry(NamedTuple):
    """A page's place in the navigation."""

    name: str
    """Its text is `nav.NAME` of the catalogue, its icon `NAME` of `icons.html.j2`."""
    path: str


@cache
def modules() -> tuple[ModuleType, ...]:
    """Return the pages' modules."""
    return tuple(importlib.import_module(name) for name in PAGES)


@cache
def entries() -> tuple[Entry, ...]:
    """Return the navigation's entries."""
    return tuple(module.ENTRY for module in modules() if hasattr(module, "ENTRY"))


def parts() -> Mapping[str, Part]:
    """Return the live parts of all pages."""
    return {name: part for module in modules() for name, part in getattr(module, "PARTS", {}).items()}

"""Navigation: the pages' routes, their places in the navigation, their live parts."""

import importlib
from collections.abc import Mapping
from functools import cache
from types import ModuleType
from typing import NamedTuple

from hmi.web.folders import FOLDERS
from hmi.web.live import Part


class Entry(NamedTuple):
    """A page's place in the navigation."""

    name: str
    """Its text is `nav.NAME` of the catalogue, its icon `NAME` of `icons.html.j2`."""
    path: str


@cache
def modules() -> tuple[ModuleType, ...]:
    """Return the modules with `router`; where they have them, `ENTRY`, their place in the navigation, and `PARTS`."""
    return tuple(importlib.import_module(f"hmi.{folder}.routes") for folder in (*FOLDERS, "api"))


@cache
def entries() -> tuple[Entry, ...]:
    """Return the navigation's entries."""
    return tuple(module.ENTRY for module in modules() if hasattr(module, "ENTRY"))


def parts() -> Mapping[str, Part]:
    """Return the live parts of all pages."""
    return {name: part for module in modules() for name, part in getattr(module, "PARTS", {}).items()}

"""Text of a page: an id and its English; templates and code name the id."""

from collections.abc import Mapping
from functools import cache
from importlib import import_module

from hmi.web.folders import FOLDERS
from station.messages.message import Definition, fields

_TEXTS: dict[str, Definition] = {}


def define(id: str, english: str) -> None:  # noqa: A002 (the field's word, and positional)
    """Define a text; Babel finds the call and takes id and text from it.

    Args:
        id: `page.what`, unique.
        english: the text, each value in braces.

    Raises:
        ValueError: the id is taken.
    """
    _keep(Definition(id, english, {}))


def define_plural(id: str, english: str, plural: str, counted: str) -> None:  # noqa: A002
    """Define a text whose form depends on a number.

    Args:
        id: `page.what`, unique.
        english: the text for one.
        plural: the text for all other numbers.
        counted: the value that decides; it is passed as a number.

    Raises:
        ValueError: the id is taken, or the plural does not contain the number.
    """
    if counted not in fields(plural):
        raise ValueError(f"{id}: the plural lacks {counted}")
    _keep(Definition(id, english, {}, plural, counted))


@cache
def texts() -> Mapping[str, Definition]:
    """Return the texts of all pages by their ids."""
    for folder in FOLDERS:
        import_module(f"hmi.{folder}.texts")
    return _TEXTS


def _keep(new: Definition) -> None:
    if new.id in _TEXTS:
        raise ValueError(f"{new.id} is defined twice")
    _TEXTS[new.id] = new

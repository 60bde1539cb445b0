"""Recipe files of a folder: reading, locking, and atomic writing with a backup."""

import fcntl
import logging
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from station.atomic_file import sync_folder, write_atomically
from station.messages import recipes as messages
from station.messages import settings as texts
from station.recipe_store.recipe_state import ValidFile
from station.recipe_store.revision import RecipeStoreError
from station.records.database import stamp
from station.settings.problems import Problem, SettingsError, shortened_file
from station.settings.recipe import UNIQUE, check_recipes, load_recipe, recipe_files
from station.settings.recipe_versions import parse_recipe
from station.settings.yaml_loader import parse_document

BACKUPS = "recipe_backups"
_LOCK = "recipes.lock"

log = logging.getLogger(__name__)


class Folder(NamedTuple):
    """Content of a recipe folder."""

    found: tuple[ValidFile, ...]
    broken: dict[str, list[Problem]]
    """Errors of the invalid files, by their stems."""
    problems: tuple[Problem, ...]
    """All errors, conflicts between files included."""


def read_folder(folder: Path | None) -> Folder:
    """Read every recipe of a site's folder, or the shipped recipes, also if some are invalid.

    Raises:
        SettingsError: the folder cannot be read or holds no recipe.
    """
    files = recipe_files(folder)
    checked = check_recipes(files)
    found, problems = [], list(checked.problems)
    for path in checked.recipes:
        try:
            text = path.read_text(encoding="utf-8-sig")
            found.append(ValidFile(path, text, parse_recipe(text, shortened_file(path))))  # as it is now, with its text
        except (OSError, UnicodeDecodeError) as error:
            expected = texts.UNREADABLE(error=str(error))
            problems.append(Problem(texts.LINE(file=shortened_file(path), line=1), texts.FILE(), expected))
        except SettingsError as error:
            problems += error.problems
    good = {file.path.stem for file in found}
    broken = {
        path.stem: [problem for problem in problems if problem.place.parameters.get("file") == shortened_file(path)]
        for path in files
        if path.stem not in good
    }
    return Folder(tuple(found), broken, tuple(problems))


def check_unique(path: Path, text: str, source: str) -> None:
    """Check that no other file of the folder has the name or PLC number of the recipe to be written to `path`.

    Raises:
        SettingsError: one has.
    """
    recipe, document = parse_recipe(text, source), parse_document(text.encode(), source)
    problems = []
    for other in recipe_files(path.parent):
        if other == path:
            continue
        with suppress(SettingsError):  # an invalid one clashes with nothing
            found = load_recipe(other)
            problems += [
                Problem(*document.locate((field,)), texts.RECIPE_TWICE(value=str(value), file=shortened_file(other)))
                for field in UNIQUE
                if (value := getattr(found, field)) == getattr(recipe, field)
            ]
    if problems:
        raise SettingsError(problems)


@contextmanager
def locked(home: Path) -> Iterator[None]:
    """Lock the recipes against other commands inside the block.

    Raises:
        RecipeStoreError: another command changes them now, or the folder cannot be written.
    """
    try:
        home.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(home / _LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    except OSError as error:
        raise _unwritable(home, error) from error
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    except BlockingIOError as error:
        raise RecipeStoreError(messages.SOMEBODY_ELSE()) from error
    finally:
        os.close(descriptor)


@contextmanager
def prepared(path: Path, text: str, home: Path) -> Iterator[Callable[[], None]]:
    """Write a recipe's new file beside the present one, which is stored as a backup in the home folder.

    Yields a function that puts the new file in the present one's place, atomically, without a wait for the disk before.
    Both raise RecipeStoreError if it cannot be written; the present file is then unchanged.
    """
    new = path.with_name(f".{path.name}.new")
    try:
        mode = None
        if path.exists():
            backup = home / BACKUPS / f"{path.stem}-{stamp()}{path.suffix}"
            backup.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(backup, path.read_bytes())
            mode = path.stat().st_mode & 0o777
        write_atomically(new, text.encode(), mode)
    except OSError as error:
        raise _unwritable(path, error) from error

    def put_in_place() -> None:
        try:
            new.replace(path)
        except OSError as error:
            raise _unwritable(path, error) from error
        try:
            sync_folder(path.parent)
        except OSError as error:  # the new file is in place all the same: to call it unchanged would be untrue
            log.warning("%s: written, but a loss of power may bring the former file back: %s", path, error)

    try:
        yield put_in_place
    finally:
        with suppress(OSError):
            new.unlink(missing_ok=True)


def _unwritable(path: Path, error: OSError) -> RecipeStoreError:
    return RecipeStoreError(messages.NOT_WRITABLE(file=str(path), error=error.strerror or str(error)))

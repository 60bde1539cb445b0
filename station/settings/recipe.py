"""Recipe files: search and reading, alone or a folder of them."""

import difflib
import importlib.resources
import json
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from station.errors import BadInputError
from station.messages import settings as messages
from station.messages.message import Message
from station.settings.file_content import read_content
from station.settings.problems import Problem, SettingsError, shortened, shortened_file
from station.settings.recipe_model import Recipe
from station.settings.recipe_versions import content_sha256, recipe_of
from station.settings.yaml_loader import read_document

SUFFIXES = (".yaml", ".yml")
UNIQUE = ("name", "plc_number")
"""Values by which a recipe is chosen: of two files with the same one, neither is used."""
APPROVED_NAME = "approved.json"
"""Beside the shipped recipes: the hashes by which the distribution approves them, so that a change is noticed."""


class Checked(NamedTuple):
    """Result of reading several files."""

    recipes: dict[Path, Recipe]
    """The good ones, by their files; of recipes that clash with each other, none."""
    problems: tuple[Problem, ...]


def load_recipe(path: Path) -> Recipe:
    """Read one recipe.

    Raises:
        SettingsError: all problems of the file.
    """
    return recipe_of(read_content(path), shortened_file(path))


def load_recipes(folder: Path | None = None) -> dict[str, Recipe]:
    """Read all recipes of a folder, of those shipped with the station by default, by name.

    Raises:
        SettingsError: all problems of all files; the folder cannot be read or holds no recipe; two files hold the
            same name or PLC number.
    """
    checked = check_recipes(recipe_files(folder))
    if checked.problems:
        raise SettingsError(checked.problems)
    return {recipe.name: recipe for recipe in checked.recipes.values()}


def find_recipe(name_or_path: str | Path, folder: Path | None = None) -> Recipe:
    """Read a recipe by its name, or by its file's path: text that ends in `.yaml` or holds a separator is a path.

    A broken file beside the wanted one does no harm.

    Args:
        name_or_path: the user's input.
        folder: searched for names; the recipes shipped with the station by default.

    Raises:
        BadInputError: there is no such recipe; the message lists the existing ones. Or its file is invalid.
    """
    if isinstance(name_or_path, Path) or "/" in name_or_path or name_or_path.endswith(SUFFIXES):
        return load_recipe(Path(name_or_path))
    files = recipe_files(folder)
    checked = check_recipes(files)
    known = {recipe.name: recipe for recipe in checked.recipes.values()}
    if name_or_path in known:
        return known[name_or_path]
    near = difflib.get_close_matches(name_or_path, known, n=1)
    hint = f"did you mean {near[0]}? " if near else ""
    problems = "".join(f"\n{problem}" for problem in checked.problems)
    raise BadInputError(
        f"recipe {shortened(name_or_path)}: {hint}expected the path of a .yaml file or one of "
        f"{', '.join(sorted(known)) or 'no recipe at all'} (in {files[0].parent}){problems}"
    )


def recipe_files(folder: Path | None = None) -> list[Path]:
    """Return the recipe files of a folder, of the shipped recipes by default, sorted by name.

    Raises:
        SettingsError: the folder cannot be read or holds no recipe.
    """
    folder = shipped_folder() if folder is None else folder
    try:
        files = sorted(path for path in folder.iterdir() if path.suffix in SUFFIXES and path.name[0] != ".")
    except (OSError, ValueError) as error:
        reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
        raise _folder_error(folder, messages.NO_FOLDER(error=reason.lower())) from error
    if not files:
        raise _folder_error(folder, messages.NO_RECIPES())
    return files


def _folder_error(folder: Path, expected: Message) -> SettingsError:
    return SettingsError([Problem(messages.PATH(path=shortened_file(folder)), messages.FOLDER(), expected)])


def shipped_folder() -> Path:
    """Return the folder of the recipes shipped with the station."""
    return Path(str(importlib.resources.files("recipes")))


def approved_by_distribution() -> dict[str, str]:
    """Return the content hashes of the shipped recipes, by name; empty if the list was removed."""
    try:
        listed = json.loads((shipped_folder() / APPROVED_NAME).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return {str(name): str(sha256) for name, sha256 in listed.items()} if isinstance(listed, dict) else {}


def approved_list(folder: Path | None = None) -> str:
    """Return the content of that list for the recipes of a folder, the shipped ones by default."""
    hashes = {recipe.name: content_sha256(recipe) for recipe in load_recipes(folder).values()}
    return json.dumps(hashes, indent=2, sort_keys=True) + "\n"


def check_recipes(files: Iterable[Path]) -> Checked:
    """Read many recipes, including those with errors."""
    recipes: dict[Path, Recipe] = {}
    problems: list[Problem] = []
    for path in files:
        try:
            recipes[path] = load_recipe(path)
        except SettingsError as error:
            problems += error.problems
    clashing: set[Path] = set()
    for field in UNIQUE:
        first: dict[str | int, Path] = {}
        for path, recipe in recipes.items():
            value = getattr(recipe, field)
            other = first.setdefault(value, path)
            if other != path:
                clashing |= {other, path}
                expected = messages.RECIPE_TWICE(value=str(value), file=shortened_file(other))
                problems.append(Problem(*read_document(path).locate((field,)), expected))
    return Checked({path: recipe for path, recipe in recipes.items() if path not in clashing}, tuple(problems))

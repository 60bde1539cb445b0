"""The recipes that the station can inspect by, and the one that is active; a broken file's last good form stays."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from pydantic import ValidationError

from station.records.model import RecipeSnapshot
from station.service.keeping import Kept
from station.settings.problems import SettingsError
from station.settings.recipe import Recipe, check_recipes, recipe_files

_ACTIVE = "active_recipe.json"
_GOOD = "recipes"


@dataclass(frozen=True, slots=True)
class Active:
    """A recipe, frozen: what it is, and what the PLC and the records know it by."""

    recipe: Recipe
    snapshot: RecipeSnapshot

    @classmethod
    def of(cls, recipe: Recipe) -> "Active":
        """Freeze a recipe.

        Args:
            recipe: as read.
        """
        return cls(recipe, RecipeSnapshot.of(recipe.model_dump(mode="json")))


class RecipeBook:
    """The site's recipes.

    Each good recipe is kept in the home folder. Where its file is broken later, the kept one is used and `problems`
    says so; a file that was removed takes its recipe with it.

    Args:
        folder: the site's recipe files; None for those shipped.
        kept: where good recipes and the active one are kept.
    """

    def __init__(self, folder: Path | None, kept: Kept) -> None:
        self._folder, self._kept = folder, kept
        self._recipes: dict[int, Recipe] = {}
        self.problems: tuple[str, ...] = ()
        """What is wrong with the files, as of the last reading; one sentence each."""

    @property
    def numbers(self) -> tuple[int, ...]:
        """The PLC's numbers of the recipes that can be chosen."""
        return tuple(sorted(self._recipes))

    def read(self) -> None:
        """Read the files again. Blocks for some milliseconds a file."""
        try:
            files = recipe_files(self._folder)
        except SettingsError as error:
            self.problems = tuple(map(str, error.problems))
            good = [_parsed(self._kept.read(str(Path(_GOOD, name)))) for name in self._kept_names()]
            self._take(recipe for recipe in good if recipe is not None)
            return
        checked = check_recipes(files)
        self.problems = tuple(map(str, checked.problems))
        recipes = list(checked.recipes.values())
        for path, recipe in checked.recipes.items():
            self._kept.write(f"{_GOOD}/{path.stem}.json", _canonical(recipe))
        for path in set(files) - set(checked.recipes):
            last_good = _parsed(self._kept.read(f"{_GOOD}/{path.stem}.json"))
            if last_good is not None:
                recipes.append(last_good)
        self._take(recipes)

    def find(self, number: int) -> Active | None:
        """A recipe by the PLC's number.

        Args:
            number: as in the recipe's `plc_number`.
        """
        recipe = self._recipes.get(number)
        return None if recipe is None else Active.of(recipe)

    def last_active(self) -> Active | None:
        """The recipe that was chosen last, in its present form; None where none was, or it is gone."""
        recipe = _parsed(self._kept.read(_ACTIVE))
        found = None if recipe is None else self.find(recipe.plc_number)
        return found if found is not None and recipe is not None and found.recipe.name == recipe.name else None

    def remember(self, active: Active) -> bool:
        """Keep the choice over a restart.

        Args:
            active: the recipe chosen.

        Returns:
            Whether it was kept.
        """
        return self._kept.write(_ACTIVE, _canonical(active.recipe))

    def _take(self, recipes: Iterable[Recipe]) -> None:
        taken: dict[int, Recipe] = {}
        for recipe in recipes:  # a last good form may clash with a good file; the file wins
            taken.setdefault(recipe.plc_number, recipe)
        self._recipes = taken

    def _kept_names(self) -> list[str]:
        folder = self._kept.folder / _GOOD
        return sorted(path.name for path in folder.glob("*.json")) if folder.is_dir() else []


def _canonical(recipe: Recipe) -> bytes:
    return Active.of(recipe).snapshot.text.encode()


def _parsed(data: bytes | None) -> Recipe | None:
    """A kept recipe; None where there is none, or it is of another version of the form."""
    if data is None:
        return None
    try:
        return Recipe.model_validate_json(data)
    except ValidationError:
        return None

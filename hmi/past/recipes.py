"""Recipes, read without the station: their files, states and revisions, and the curves of their past fruit."""

import json
from pathlib import Path
from typing import NamedTuple

from hmi.past.worker import PastWorker
from station.errors import BadInputError
from station.inspection.evidence import Evidence
from station.inspection.press import Press
from station.inspection.sized_limits import SizedLimits
from station.messages import recipes as messages
from station.messages.message import Message, message_of
from station.recipe_store.difference import Difference, differences
from station.recipe_store.reader import RecipeReader
from station.recipe_store.recipe_state import RecipeState
from station.recipe_store.revision import Revision
from station.records.database import reading, records_folder
from station.settings.problems import SettingsError, shortened
from station.settings.recipe import shipped_folder
from station.settings.recipe_model import Recipe
from station.whatif.stored import StoredPress, read_stored, sequences

__all__ = ["PastCurve", "PastRecipes", "RecipeList", "RecipeState", "changes_of", "recipe_of"]

_REVISIONS = 20
"""Revisions on one page of a history."""
_CURVES = 60
_LONGEST_VALUE = 400


class RecipeList(NamedTuple):
    """All recipes, by name."""

    states: tuple[RecipeState, ...]
    problems: tuple[Message, ...]
    """Problems of the folder's files."""
    editable: bool
    """Whether the folder is the site's; the shipped one belongs to the software."""
    folder: Path
    own_folder: Path
    """A possible folder for a site's own."""


class RevisionPage(NamedTuple):
    """Revisions, newest first, each with the differences from the one before it."""

    revisions: tuple[tuple[Revision, tuple[Difference, ...]], ...]
    below: int | None


class PastCurve(NamedTuple):
    """One fruit's curve."""

    outcome: str
    """The judge's, independent of what happened to the fruit afterwards: it is compared with limits."""
    points: tuple[tuple[float, float], ...]
    """Closing in mm and area in mm²."""
    growth_mm2_per_mm: float | None
    """The steepest, as the judge reckons it; None with too few points."""
    onset_mm: float | None
    """The fruit's width."""
    confidence: float | None
    """Of the last point that the judge needs."""


class PastRecipes:
    """Reader of the recipes, with the errors of `Past`; a `BadInputError` says that there is no such revision or file.

    Args:
        folder: the site's recipe files; None for the shipped ones.
    """

    def __init__(self, home: Path, folder: Path | None, worker: PastWorker) -> None:
        self._reader, self._records, self._worker = RecipeReader(home, folder), records_folder(home), worker
        self._folder, self._own_folder = folder or shipped_folder(), home / "recipes"

    async def read(self) -> RecipeList:
        """Return the recipes with their states."""
        states, problems = await self._worker.do(self._reader.read)
        editable = self._folder.resolve() != shipped_folder().resolve()
        return RecipeList(states, problems, editable, self._folder, self._own_folder)

    async def revision(self, name: str, revision: int) -> Revision:
        """Return one revision."""
        return await self._worker.do(lambda: self._reader.revision(name, revision))

    async def history(self, name: str, below: int | None) -> RevisionPage:
        """Return a page of a recipe's revisions: the first one, or that below a revision."""

        def read() -> RevisionPage:
            known = self._reader.history(name)
            pairs = list(zip(known, [None, *known], strict=False))[::-1]
            chosen = [pair for pair in pairs if below is None or pair[0].revision < below]
            page = tuple((each, _changes_since(before, each)) for each, before in chosen[:_REVISIONS])
            return RevisionPage(page, page[-1][0].revision if len(chosen) > _REVISIONS else None)

        return await self._worker.do(read)

    async def export_text(self, name: str, revision: int | None) -> str:
        """Return a recipe's text, to be imported again."""
        return await self._worker.do(lambda: self._reader.export_text(name, revision))

    async def curves(self, recipe: Recipe) -> tuple[PastCurve, ...]:
        """Return the last curves of a recipe's fruit that the judge passed or failed."""

        def read() -> tuple[PastCurve, ...]:
            with reading(self._records) as connection:
                wanted = sequences(connection, recipe.name, (), _CURVES, ("PASS", "FAIL"))
                stored = read_stored(connection, wanted, self._records, with_images=False)
            return tuple(_curve(each, recipe) for each in stored)

        return await self._worker.do(read)


def recipe_of(revision: Revision) -> Recipe:
    """Return a revision's recipe.

    Raises:
        BadInputError: this program does not accept it any more.
    """
    try:
        return revision.recipe
    except SettingsError as error:
        raise BadInputError(messages.REVISION_NOT_ACCEPTED(why=message_of(error))) from error


def changes_of(old: Recipe, new: Recipe) -> tuple[Difference, ...]:
    """Return every value that differs, as text."""
    return tuple(Difference(path, _text(before), _text(after)) for path, before, after in differences(old, new))


def _changes_since(before: Revision | None, revision: Revision) -> tuple[Difference, ...]:
    try:
        return () if before is None else changes_of(before.recipe, revision.recipe)
    except SettingsError:  # of a schema version that this program does not accept
        return ()


def _text(value: object) -> str:
    return shortened(value if isinstance(value, str) else json.dumps(value, ensure_ascii=False), _LONGEST_VALUE)


def _curve(stored: StoredPress, recipe: Recipe) -> PastCurve:
    points = tuple(point for point in stored.press.points if point.closing_mm >= 0)
    onset_mm = stored.press.onset_mm
    evidence = Evidence(Press(onset_mm, 0.0, points, ()), SizedLimits(recipe))
    return PastCurve(
        stored.before,
        tuple((point.closing_mm, point.area_mm2) for point in points),
        max((growth.mm2_per_mm for growth in evidence.growths), default=None),
        onset_mm,
        evidence.needed[-1].confidence if evidence.needed else None,
    )

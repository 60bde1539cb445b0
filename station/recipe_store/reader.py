"""Reader of a station's recipes, for any process. Every method blocks, and nothing is written."""

import contextlib
import re
from collections.abc import Hashable
from pathlib import Path

from station.errors import BadInputError
from station.messages import recipes as messages
from station.messages.message import Message
from station.recipe_store.files import Folder, read_folder
from station.recipe_store.history import read_revisions
from station.recipe_store.recipe_state import RecipeState, recipe_states
from station.recipe_store.revision import Revision
from station.records.database import FILE_NAME, reading, records_folder
from station.records.errors import RecordsError
from station.settings.problems import SettingsError, shortened
from station.settings.recipe import shipped_folder
from station.settings.recipe_model import Recipe
from station.settings.recipe_versions import content_sha256

BASE = re.compile(r"^# base: sha256 ([0-9a-f]{64})\n", re.MULTILINE)
"""Line of an exported file with the version that it was exported of."""


def text_with_base(text: str, base: Recipe | None) -> str:
    """Return a recipe's text that names, in its first line, the version that it is based on; none for a new recipe."""
    line = "" if base is None else f"# base: sha256 {content_sha256(base)}\n"
    return line + BASE.sub("", text, count=1)


class RecipeReader:
    """Recipes of one station: the files that people edit, or those shipped, and the history of approved revisions."""

    def __init__(self, home: Path, folder: Path | None) -> None:
        self._home, self._folder, self._records = home, folder, records_folder(home)

    def read(self) -> tuple[tuple[RecipeState, ...], tuple[Message, ...]]:
        """Return the state of each recipe, and the errors of the files and their folder.

        Raises:
            RecordsError: the history cannot be read.
        """
        try:
            folder = read_folder(self._folder)
        except SettingsError as error:
            folder = Folder((), {"": list(error.problems)}, error.problems)
        problems = tuple(each.message for each in folder.problems)
        return recipe_states(folder.found, folder.broken, self.history()), problems

    def signature(self) -> Hashable:
        """Return a value that differs whenever a file or the history has changed."""
        folder = self._folder or shipped_folder()
        files = []
        with contextlib.suppress(OSError):
            for path in sorted(folder.iterdir()):
                with contextlib.suppress(OSError):
                    stat = path.stat()
                    files.append((path.name, stat.st_mtime_ns, stat.st_size, stat.st_ino))
        try:
            history = [(each.name, each.revision, each.status) for each in self.history()]
        except RecordsError as error:
            return tuple(files), str(error)
        return tuple(files), tuple(history)

    def history(self, name: str = "") -> list[Revision]:
        """Return the revisions of a recipe, or of all, oldest first; none before the history began.

        Raises:
            RecordsError: they cannot be read.
        """
        if not (self._records / FILE_NAME).exists():
            return []
        with reading(self._records) as connection:
            return read_revisions(connection, name)

    def state(self, name: str) -> RecipeState:
        """Return the state of one recipe.

        Raises:
            BadInputError: there is none of this name.
        """
        every, _ = self.read()
        for standing in every:
            if standing.name == name:
                return standing
        known = ", ".join(standing.name for standing in every)
        raise BadInputError(messages.UNKNOWN(recipe=shortened(name), known=known))

    def revision(self, name: str, revision: int) -> Revision:
        """Return one revision.

        Raises:
            BadInputError: there is none.
        """
        history = self.history(name)
        for each in history:
            if each.revision == revision:
                return each
        known = ", ".join(str(each.revision) for each in history)
        if not known:
            raise BadInputError(messages.NO_REVISION(recipe=shortened(name), revision=revision))
        raise BadInputError(messages.UNKNOWN_REVISION(recipe=shortened(name), revision=revision, known=known))

    def export_text(self, name: str, revision: int | None = None) -> str:
        """Return a recipe's present file, or a revision's; `import_text` notices later changes by its first line.

        Raises:
            BadInputError: there is none.
        """
        state = self.state(name)
        text = state.valid_file.text if revision is None else self.revision(name, revision).text
        return text_with_base(text, None if state.file is None else state.file.recipe)

"""Recipe editor: changes a recipe's file by values, by import, by revert or by an upgrade of its schema.

Every change makes an unapproved draft at most; the revision in force does not change until a draft is approved.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from station.errors import BadInputError
from station.messages import recipes as messages
from station.recipe_store.files import check_unique, locked, prepared, read_folder
from station.recipe_store.history import Person
from station.recipe_store.reader import BASE
from station.recipe_store.recipe_state import RecipeState, ValidFile
from station.recipe_store.revision import ConflictError, RecipeStoreError, Status
from station.recipe_store.store import RecipeStore
from station.records.audit import AuditEntry, append_audit
from station.records.database import records_folder
from station.records.direct_transaction import direct_transaction
from station.settings.recipe import shipped_folder
from station.settings.recipe_model import Recipe
from station.settings.recipe_text import upgraded_text, with_values
from station.settings.recipe_versions import content_sha256, parse_recipe

_SHORTEST_BASE = 8
_IMPORT = "import.yaml"
"""Name of an imported text for messages."""


class RecipeEditor:
    """Editor of a site's recipe files; the shipped ones, None, cannot be edited in place. Every method blocks."""

    def __init__(self, home: Path, folder: Path | None) -> None:
        self._home, self._folder = home, folder
        self._store = RecipeStore(home, folder)

    def edit(self, name: str, changes: Mapping[str, Any], person: Person, base: str = "") -> RecipeState:
        """Change values, by their dotted paths, in a recipe's file; comments remain. It is then an unapproved draft.

        Args:
            base: content hash, or its beginning, of the version that the editor has seen; empty for the present one.

        Raises:
            BadInputError: the recipe would be invalid, or another file has its name or PLC number; the file is
                unchanged.
            ConflictError: the file is another version.
            RecipeStoreError: the file cannot be written.
        """
        with self._editing(name) as file:
            self._check_base(file, base)
            text, recipe = with_values(file.text, changes, str(file.path))
            check_unique(file.path, text, str(file.path))
            self._put(file, text, recipe, "recipe.edited", person)
        return self._store.state(name)

    def import_text(self, text: str, person: Person, base: str = "") -> RecipeState:
        """Replace a recipe's file. The file is then an unapproved draft.

        Args:
            text: YAML; an exported text names its base version in its first lines.
            base: as for `edit`; empty for the one that the text names.

        Raises:
            BadInputError: the recipe is invalid, another file has its name or PLC number, or neither text nor caller
                names the base version.
            ConflictError: the file was changed since it was exported.
            RecipeStoreError: the file cannot be written.
        """
        recipe = parse_recipe(text, _IMPORT)
        named = BASE.search(text)
        base = base or (named[1] if named else "")
        body = BASE.sub("", text, count=1)
        with locked(self._home):
            files = {file.recipe.name: file for file in read_folder(self._sites()).found}
            file = files.get(recipe.name)
            if file is None:
                path = self._sites() / f"{recipe.name}.yaml"
                if path.exists():
                    raise RecipeStoreError(messages.FILE_IN_THE_WAY(file=str(path)))
                check_unique(path, text, _IMPORT)
                self._put(ValidFile(path, "", recipe), body, recipe, "recipe.imported", person)
            else:
                if not base:
                    raise BadInputError(messages.NO_BASE(recipe=recipe.name))
                self._check_base(file, base)
                check_unique(file.path, text, _IMPORT)
                self._put(file, body, recipe, "recipe.imported", person)
        return self._store.state(recipe.name)

    def revert(self, name: str, person: Person, revision: int | None = None) -> RecipeState:
        """Put a revision's text, or else the approved one's, back into the file; store the present text as a backup.

        Raises:
            BadInputError: there is none, or another file has its name or PLC number.
            RecipeStoreError: the file cannot be written.
        """
        with locked(self._home):
            history = self._store.history(name)
            approved = next((each for each in history if each.status is Status.APPROVED), None)
            wanted = approved if revision is None else self._store.revision(name, revision)
            if wanted is None:
                raise BadInputError(messages.NONE_APPROVED(recipe=name))
            good = {file.recipe.name: file for file in read_folder(self._sites()).found}
            path = good[name].path if name in good else self._sites() / f"{name}.yaml"
            check_unique(path, wanted.text, path.name)
            self._put(ValidFile(path, "", wanted.recipe), wanted.text, wanted.recipe, "recipe.reverted", person)
        return self._store.state(name)

    def upgrade(self, person: Person) -> list[tuple[Path, int]]:
        """Convert every file of an earlier schema to this program's, comments included, with a backup.

        Returns:
            The files written, and the schema versions that they had.
        """
        done = []
        with locked(self._home):
            for file in read_folder(self._sites()).found:
                made = upgraded_text(file.text, str(file.path))
                if made is not None:
                    self._put(file, made[0], file.recipe, "recipe.upgraded", person)
                    done.append((file.path, made[1]))
        return done

    @contextmanager
    def _editing(self, name: str) -> Iterator[ValidFile]:
        with locked(self._home):
            self._sites()
            yield self._store.state(name).valid_file

    def _check_base(self, file: ValidFile, base: str) -> None:
        """Check that the file is the version that the editor has seen."""
        now = content_sha256(file.recipe)
        if not base or (len(base) >= _SHORTEST_BASE and now.startswith(base.lower())):
            return
        seen = [each for each in self._store.history(file.recipe.name) if each.sha256.startswith(base.lower())]
        words = {"recipe": file.recipe.name, "base": base[:12], "now": now[:12]}
        if seen and len(base) >= _SHORTEST_BASE:
            raise ConflictError(messages.CHANGED_SINCE_IN(**words, changes=seen[-1].changes_to(file.recipe)))
        raise ConflictError(messages.CHANGED_SINCE(**words))

    def _put(self, file: ValidFile, text: str, recipe: Recipe, action: str, person: Person) -> None:
        """Write a file and its audit entry: the entry first, so that no change is made without one.

        All that waits for the disk is done outside of the transaction, in which the station cannot write.
        """
        old = content_sha256(parse_recipe(file.text, str(file.path))) if file.text else None
        new = {"sha256": content_sha256(recipe), "file": file.path.name}
        entry = AuditEntry(
            person.who, person.role, action, f"recipe {recipe.name}", person.reason, {"sha256": old}, new
        )
        with prepared(file.path, text, self._home) as put_in_place:
            self._append(entry)
            try:
                put_in_place()
            except RecipeStoreError as error:
                unchanged = {"sha256": old, "file": file.path.name, "why": str(error)}
                self._append(replace(entry, action="recipe.not_written", old=new, new=unchanged))
                raise

    def _append(self, entry: AuditEntry) -> None:
        with direct_transaction(records_folder(self._home)) as connection:
            append_audit(connection, entry)

    def _sites(self) -> Path:
        if self._folder is None or self._folder.resolve() == shipped_folder().resolve():
            raise RecipeStoreError(messages.SHIPPED())
        return self._folder

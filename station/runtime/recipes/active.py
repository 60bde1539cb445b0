"""Active recipes: the approved revisions that the station may inspect by, also without files and history."""

import contextlib
import json
import logging
from collections.abc import Hashable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from station.errors import StationError
from station.messages import recipes as messages
from station.messages.message import Message, message_of
from station.recipe_store.difference import described_differences
from station.recipe_store.recipe_state import Control, FileState, RecipeState
from station.recipe_store.revision import RecipeStoreError
from station.recipe_store.store import RecipeStore
from station.records.audit import STATION, AuditEntry
from station.records.errors import RecordsError
from station.records.model import RecipeSnapshot
from station.settings.problems import SettingsError
from station.settings.recipe_model import Recipe
from station.settings.recipe_versions import content_sha256
from station.state_files import StateFiles

_ACTIVE = "active_recipe.json"
_CONTROLS = "control_recipes"

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class ActiveRecipe:
    """A frozen recipe with its name for the PLC and the records."""

    recipe: Recipe
    snapshot: RecipeSnapshot

    @classmethod
    def of(cls, recipe: Recipe, revision: str = "") -> "ActiveRecipe":
        """Freeze a recipe."""
        return cls(recipe, RecipeSnapshot.of(recipe.model_dump(mode="json"), revision))


class RestoredRecipe(NamedTuple):
    """The recipe of the station's previous start."""

    active: ActiveRecipe
    lot: str | None
    """The lot under way; None if none had begun with this recipe."""


class ActiveRecipes:
    """Recipes in force on this site, by the files of its folder or those shipped.

    Each is stored in the home folder too: if the history cannot be read, the stored one stays in force. A recipe whose
    file was removed is not in force any more; an edit of the file changes nothing, and `problems` reports it.
    """

    def __init__(self, folder: Path | None, state_files: StateFiles) -> None:
        self._store, self._state_files = RecipeStore(state_files.folder, folder), state_files
        self._controls: dict[int, Control] = {}
        self._noticed: set[tuple[str, str]] = set()
        self._signature: Hashable = None
        self.problems: tuple[Message, ...] = ()
        """Problems of the files at the last reading."""
        self._entries: list[AuditEntry] = []

    def take_noticed(self) -> list[AuditEntry]:
        """Return the audit entries of drafts and gaps that were found since the last call."""
        entries, self._entries = self._entries, []
        return entries

    @property
    def numbers(self) -> tuple[int, ...]:
        """Return the PLC's numbers of the recipes that can be chosen."""
        return tuple(sorted(self._controls))

    def read(self) -> None:
        """Read files and history again. Blocks for some milliseconds a file."""
        # Before the files are read: what changes meanwhile is read at the next refresh.
        self._signature = self._store.signature()
        stored, begun = self._stored_controls(), True
        try:
            self._store.begin({name: control.recipe for name, control in stored.items()})
        except (RecordsError, RecipeStoreError, SettingsError) as error:
            begun = False
            log.warning("the recipes' history was not continued: %s", error)
        try:
            states, broken = self._store.read()
        except RecordsError as error:
            states, broken = (), (messages.STORED_ONES(folder=_CONTROLS, why=message_of(error)),)
        controls = {each.name: each.control for each in states if each.control is not None}
        if not begun and not controls:
            self.problems = broken
            self._take(stored.values())
            return
        self._audit_files(states)
        notes = [each.note for each in states if each.note is not None]
        enclosed = {
            part for note in notes for parts in note.parameters.values() if isinstance(parts, tuple) for part in parts
        }
        self.problems = tuple(dict.fromkeys([*(each for each in broken if each not in enclosed), *notes]))
        gone = {each.name for each in states if each.file_state is FileState.MISSING}
        self._take(control for name, control in controls.items() if name not in gone)
        self._store_controls(controls)

    def refresh(self) -> None:
        """Read again if a file, its folder or the history has changed since. Blocks for some milliseconds."""
        if self._store.signature() != self._signature:
            self.read()

    def find(self, number: int) -> ActiveRecipe | None:
        """Return the recipe in force with a PLC number."""
        control = self._controls.get(number)
        return None if control is None else ActiveRecipe.of(control.recipe, str(control.revision or ""))

    def current(self, active: ActiveRecipe) -> ActiveRecipe:
        """Return the recipe in force that replaces a lot's frozen one.

        Raises:
            RecipeStoreError: number, name and content do not match any more; the message gives the difference.
        """
        name, number = active.recipe.name, active.recipe.plc_number
        found = self.find(number)
        if found is not None and found.recipe.name == name:
            return found
        moved = next((c.recipe.plc_number for c in self._controls.values() if c.recipe.name == name), None)
        if moved is not None:
            raise RecipeStoreError(messages.MOVED(recipe=name, now=moved, before=number))
        if found is not None:
            raise RecipeStoreError(messages.ANOTHER(number=number, now=found.recipe.name, before=name))
        raise RecipeStoreError(messages.GONE(recipe=name, number=number))

    def restored(self) -> RestoredRecipe | None:
        """Return the recipe of the previous start; None if nothing is in force in its place.

        A lot continues with exactly the recipe that it began with, if its revision still has that content.
        """
        data = self._state_files.read(_ACTIVE)
        try:
            stored = json.loads(data or b"null")
            active = ActiveRecipe.of(Recipe.model_validate_json(json.dumps(stored["values"])), stored["revision"])
            lot, sha256 = stored["lot"], stored["sha256"]
        except (ValueError, TypeError, KeyError):
            return None
        try:
            current = self.current(active)
        except RecipeStoreError:
            return None
        whole = active.snapshot.sha256 == sha256 and self._is_revision(active)
        return RestoredRecipe(active, lot) if whole and lot is not None else RestoredRecipe(current, None)

    def store_active(self, active: ActiveRecipe, lot: str | None) -> bool:
        """Store the active recipe for the next start, with the lot under way, if any; return whether it was stored."""
        snapshot = active.snapshot
        data = {"lot": lot, "revision": snapshot.revision, "sha256": snapshot.sha256}
        return self._state_files.write(_ACTIVE, json.dumps({**data, "values": json.loads(snapshot.text)}).encode())

    def _is_revision(self, active: ActiveRecipe) -> bool:
        """Check that the history has exactly this content as this revision."""
        with contextlib.suppress(StationError, ValueError):
            revision = self._store.revision(active.recipe.name, int(active.snapshot.revision))
            return revision.holds(active.recipe)
        return False

    def _take(self, controls: Iterable[Control]) -> None:
        self._controls = {control.recipe.plc_number: control for control in controls}

    def _audit_files(self, states: Iterable[RecipeState]) -> None:
        """Audit what was done to files without the commands, once for each content."""
        for state in states:
            file, control, submitted = state.file, state.control, state.submitted
            sha256 = str(state.file_state) if file is None else content_sha256(file.recipe)
            quiet = state.file_state is FileState.APPROVED or (file is None and control is None)
            if quiet or (state.name, sha256) in self._noticed:
                continue
            self._noticed.add((state.name, sha256))
            if file is not None and submitted is not None and submitted.holds(file.recipe):
                continue
            changes = str(state.file_state)
            if control and file:
                changes = str(described_differences(control.recipe, file.recipe))
            data = {"state": str(state.file_state), "sha256": sha256, "changes": changes}
            entry = AuditEntry(
                STATION, STATION, "recipe.file_noticed", f"recipe {state.name}", str(state.note or "")[:900], None, data
            )
            self._entries.append(entry)

    def _store_controls(self, controls: dict[str, Control]) -> None:
        for name, control in controls.items():
            data = {"revision": control.revision, "values": control.recipe.model_dump(mode="json")}
            self._state_files.write(f"{_CONTROLS}/{name}.json", json.dumps(data).encode())
        for name in set(self._stored_names()) - set(controls):
            with contextlib.suppress(OSError):
                (self._state_files.folder / _CONTROLS / f"{name}.json").unlink()

    def _stored_controls(self) -> dict[str, Control]:
        found = {}
        for name in self._stored_names():
            try:
                stored = json.loads(self._state_files.read(f"{_CONTROLS}/{name}.json") or b"null")
                found[name] = Control(Recipe.model_validate_json(json.dumps(stored["values"])), int(stored["revision"]))
            except (ValueError, TypeError, KeyError):
                continue  # of another schema version
        return found

    def _stored_names(self) -> list[str]:
        folder = self._state_files.folder / _CONTROLS
        return sorted(path.stem for path in folder.glob("*.json")) if folder.is_dir() else []

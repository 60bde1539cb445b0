"""Recipe store of a station, for the command line and the service. Every method blocks."""

from collections.abc import Mapping
from importlib.metadata import version

from sqlalchemy import Connection

from station.errors import BadInputError
from station.messages import recipes as messages
from station.recipe_store.files import locked, read_folder
from station.recipe_store.history import Person, approve, read_revisions, retire, store_approved, submit
from station.recipe_store.reader import RecipeReader
from station.recipe_store.recipe_state import ValidFile
from station.recipe_store.revision import Origin, RecipeStoreError, Revision, Status
from station.records.audit import AuditEntry, append_audit
from station.records.database import FILE_NAME, reading
from station.records.direct_transaction import direct_transaction
from station.settings.recipe import approved_by_distribution
from station.settings.recipe_model import Recipe
from station.settings.recipe_versions import content_sha256

BEGAN = "recipe.history_began"


class RecipeStore(RecipeReader):
    """Recipes of one station, with what changes their history."""

    def begin(self, last_good: Mapping[str, Recipe]) -> None:
        """Store the revisions that need no person's approval; call it at each start.

        Shipped recipes count as approved by the distribution. When the history begins, the recipes that the station
        inspected by until then, or else the existing files, are adopted: their installer is responsible for them.

        Raises:
            SettingsError: the folder cannot be read, or holds no recipe at all.
            RecordsError: the history cannot be written.
        """
        found = {file.recipe.name: file for file in read_folder(self._folder).found}
        if self._has_begun() and not self._to_ship(list(found.values()), self.history()):
            return
        with locked(self._home), direct_transaction(self._records) as connection:
            _adopt(connection, found, last_good)
            for file in self._to_ship(list(found.values()), read_revisions(connection)):
                who = f"fruit-station {version('fruit-station')}"
                store_approved(connection, file.text, file.recipe, Origin.SHIPPED, who, str(messages.REASON_SHIPPED()))

    def submit(self, name: str, person: Person) -> Revision:
        """Store the recipe's file as a draft for another person to approve.

        Raises:
            BadInputError: there is no valid file of that recipe, or no fruit passes by its method.
            RecipeStoreError: it is approved already, or another person's draft waits.
        """
        with locked(self._home):
            file = self.state(name).valid_file
            if file.recipe.segmentation.method == "paper":
                raise BadInputError(messages.NOT_FOR_INSPECTIONS(recipe=name))
            self._require_history()
            with direct_transaction(self._records) as connection:
                return submit(connection, file.text, file.recipe, person)

    def approve(self, name: str, person: Person, revision: int | None = None) -> Revision:
        """Put a draft in force from the next lot on.

        Args:
            person: must not be the author.
            revision: the draft that the approver has seen; None for the one that waits.

        Raises:
            BadInputError: no draft waits.
            RecipeStoreError: it is the approver's own, or the file was changed since.
        """
        with locked(self._home):
            standing = self.state(name)
            wanted = standing.submitted if revision is None else self.revision(name, revision)
            if wanted is None:
                raise BadInputError(messages.NO_DRAFT(recipe=name))
            file = None if standing.file is None else standing.file.recipe
            with direct_transaction(self._records) as connection:
                return approve(connection, wanted, file, person)

    def retire(self, name: str, person: Person, revision: int | None = None) -> Revision:
        """Take a revision, or else the approved one, out of use: no lot begins with it any more.

        Raises:
            BadInputError: there is none.
            RecipeStoreError: it is retired already.
        """
        with locked(self._home):
            self._require_history()
            history = self.history(name)
            if revision is not None:
                wanted = self.revision(name, revision)
            else:
                approved = [each for each in history if each.status is Status.APPROVED]
                if not approved:
                    raise BadInputError(messages.NONE_APPROVED(recipe=name))
                wanted = approved[0]
            with direct_transaction(self._records) as connection:
                return retire(connection, wanted, person)

    def _to_ship(self, found: list[ValidFile], history: list[Revision]) -> list[ValidFile]:
        """Return the files that are identical to the shipped ones, if no person has decided otherwise."""
        shipped, wanted = approved_by_distribution(), []
        for file in found:
            if shipped.get(file.recipe.name) != content_sha256(file.recipe):
                continue
            own = [each for each in history if each.name == file.recipe.name]
            last = next((each for each in reversed(own) if each.status is not Status.DRAFT), None)
            if last is None or (
                last.status is Status.APPROVED and last.origin is Origin.SHIPPED and not last.holds(file.recipe)
            ):
                wanted.append(file)
        return wanted

    def _has_begun(self) -> bool:
        if not (self._records / FILE_NAME).exists():
            return False
        with reading(self._records) as connection:
            return _history_has_begun(connection)

    def _require_history(self) -> None:
        """Refuse a person's change before the history has started.

        Raises:
            RecipeStoreError: it has not started.
        """
        if not self._has_begun():
            raise RecipeStoreError(messages.HISTORY_NOT_BEGUN())


def _history_has_begun(connection: Connection) -> bool:
    return connection.exec_driver_sql("SELECT 1 FROM audit WHERE action = ? LIMIT 1", (BEGAN,)).first() is not None


def _adopt(connection: Connection, found: Mapping[str, ValidFile], last_good: Mapping[str, Recipe]) -> None:
    """Begin the history, once."""
    if _history_has_begun(connection):
        return
    shipped = approved_by_distribution()
    reason = str(messages.REASON_ADOPTED())
    append_audit(connection, AuditEntry("station", "station", BEGAN, "recipes", reason))
    for name in sorted({*found, *last_good}):
        file, good = found.get(name), last_good.get(name)
        if good is not None and (file is None or file.recipe != good):
            text = good.model_dump_json(indent=2) + "\n"
            store_approved(connection, text, good, Origin.ADOPTED, "station", str(messages.REASON_USED()))
        elif file is not None and shipped.get(name) != content_sha256(file.recipe):
            store_approved(connection, file.text, file.recipe, Origin.ADOPTED, "station", reason)

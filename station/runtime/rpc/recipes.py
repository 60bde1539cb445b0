"""Recipe orders of the pages, carried out by the recipe store."""

from collections.abc import Callable
from pathlib import Path

from station.channel.line import Noted
from station.channel.panel import Actor
from station.channel.panel_recipes import (
    ApproveRecipe,
    ImportedRecipe,
    ImportRecipe,
    RejectRecipe,
    RevertRecipe,
    SaveDraft,
    SubmitRecipe,
)
from station.channel.server import Handlers
from station.channel.worker import PanelWorker
from station.errors import BadInputError
from station.messages import recipes as messages
from station.recipe_store.editor import RecipeEditor
from station.recipe_store.history import Person
from station.recipe_store.recipe_state import FileState
from station.recipe_store.revision import STATUS, ConflictError, Status
from station.recipe_store.store import RecipeStore


class PanelRecipes:
    """Changes of a site's recipe files, or of those shipped, in a worker's thread."""

    def __init__(self, home: Path, folder: Path | None, worker: PanelWorker) -> None:
        self._store, self._editor = RecipeStore(home, folder), RecipeEditor(home, folder)
        self._worker = worker
        self.handlers: Handlers = {
            SaveDraft: self.save_draft,
            SubmitRecipe: self.submit,
            ApproveRecipe: self.approve,
            RejectRecipe: self.reject,
            RevertRecipe: self.revert,
            ImportRecipe: self.import_text,
        }

    async def save_draft(self, request: SaveDraft) -> Noted:
        """Change the file, and record it as a draft."""

        def save() -> None:
            person = _person(request.actor, request.reason)
            waiting = self._store.state(request.name).submitted
            if waiting is not None and waiting.author != person.who:
                raise ConflictError(
                    messages.ANOTHER_WAITS(recipe=request.name, revision=waiting.revision, author=waiting.author)
                )
            self._editor.edit(request.name, request.values, person, request.base)
            self._store.submit(request.name, person)

        return await self._change(save)

    async def submit(self, request: SubmitRecipe) -> Noted:
        """Record the file as a draft."""
        person = _person(request.actor, request.reason)
        return await self._change(lambda: self._store.submit(request.name, person))

    async def approve(self, request: ApproveRecipe) -> Noted:
        """Put a draft in force from the next lot on."""
        person = _person(request.actor, request.reason)
        return await self._change(lambda: self._store.approve(request.name, person, request.revision))

    async def reject(self, request: RejectRecipe) -> Noted:
        """Retire a draft; no other revision can be retired here."""

        def reject() -> None:
            status = self._store.revision(request.name, request.revision).status
            if status is not Status.DRAFT:
                raise BadInputError(
                    messages.ONLY_DRAFT_REJECTED(
                        recipe=request.name, revision=request.revision, status=STATUS[status]()
                    )
                )
            self._store.retire(request.name, _person(request.actor, request.reason), request.revision)

        return await self._change(reject)

    async def revert(self, request: RevertRecipe) -> Noted:
        """Put a revision's text back into the file."""
        person = _person(request.actor, request.reason)
        return await self._change(lambda: self._editor.revert(request.name, person, request.revision))

    async def import_text(self, request: ImportRecipe) -> ImportedRecipe:
        """Put a whole recipe in the place of its file, and record it as a draft where it is another."""
        person = _person(request.actor, request.reason)

        def import_text() -> str:
            state = self._editor.import_text(request.text, person)
            if state.file_state is FileState.DRAFT:
                self._store.submit(state.name, person)
            return state.name

        return ImportedRecipe(name=await self._worker.do(import_text))

    async def _change(self, change: Callable[[], object]) -> Noted:
        await self._worker.do(change)
        return Noted()


def _person(actor: Actor, reason: str) -> Person:
    return Person(actor.who, actor.role, reason)

"""Recipe requests of the pages, carried out by the recipe store."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from station.channel.messages import ChannelMessage
from station.channel.panel import Actor
from station.channel.panel_queries import JobView
from station.channel.panel_recipe_queries import (
    ApproveRecipe,
    Change,
    Changes,
    CompareRecipe,
    ExportRecipe,
    GetPastCurves,
    GetRecipe,
    GetRecipeHistory,
    ImportRecipe,
    ListRecipes,
    PastCurve,
    PastCurves,
    RecipeHistory,
    RecipeRow,
    Recipes,
    RecipeText,
    RecipeView,
    RejectRecipe,
    RevertRecipe,
    RevisionView,
    SaveDraft,
    StartWhatIf,
    SubmitRecipe,
)
from station.channel.server import Handler
from station.channel.worker import PanelWorker
from station.errors import BadInputError, StationError
from station.inspection.evidence import Evidence
from station.inspection.press import Measured, Press
from station.inspection.sized_limits import SizedLimits
from station.messages import recipes as messages
from station.messages.jobs import NOT_WRITTEN
from station.messages.lots import UNPRINTABLE
from station.messages.message import message_of
from station.recipe_store.difference import differences
from station.recipe_store.editor import RecipeEditor
from station.recipe_store.history import Person
from station.recipe_store.recipe_state import RecipeState
from station.recipe_store.revision import STATUS, ConflictError, Revision, Status
from station.recipe_store.store import RecipeStore
from station.records.database import plain, reading, records_folder
from station.runtime.rpc.jobs import PanelJobs
from station.settings.problems import SettingsError, shortened
from station.settings.recipe import Recipe, shipped_folder
from station.settings.recipe_versions import content_sha256

_REVISIONS = 20
"""Revisions on one page of a history."""
_LONGEST_VALUE = 400
_JUDGED = (
    "SELECT i.sequence, i.outcome, json_extract(i.measures, '$.onset_mm') FROM inspections i "
    "JOIN recipe_snapshots r ON r.sha256 = i.recipe_sha256 "
    "WHERE r.name = ? AND i.judged IN ('PASS', 'FAIL') ORDER BY i.sequence DESC LIMIT ?"
)
_POINTS = (
    "SELECT closing_mm, area_mm2, area_px, confidence FROM curve_points WHERE sequence = ? AND closing_mm >= 0 "
    "AND area_mm2 NOT NULL ORDER BY step"
)


class PanelRecipes:
    """Requests about recipes, and changes of them.

    Args:
        folder: the site's recipe files; None for those shipped.
        worker: runs what blocks.
        jobs: runs what-ifs.
    """

    def __init__(self, home: Path, folder: Path | None, worker: PanelWorker, jobs: PanelJobs) -> None:
        self._store, self._editor = RecipeStore(home, folder), RecipeEditor(home, folder)
        self._folder, self._own_folder = folder or shipped_folder(), home / "recipes"
        self._editable = self._folder.resolve() != shipped_folder().resolve()
        self._records, self._worker, self._jobs = records_folder(home), worker, jobs

    def handlers(self) -> dict[type[ChannelMessage], Handler]:
        """Return the handler of each request."""
        return {
            ListRecipes: self.recipes,
            GetRecipe: self.recipe,
            GetRecipeHistory: self.history,
            CompareRecipe: self.compare,
            SaveDraft: self.save_draft,
            SubmitRecipe: self.submit,
            ApproveRecipe: self.approve,
            RejectRecipe: self.reject,
            RevertRecipe: self.revert,
            ExportRecipe: self.export,
            ImportRecipe: self.import_text,
            GetPastCurves: self.past_curves,
            StartWhatIf: self.start_whatif,
        }

    async def recipes(self, _request: ListRecipes) -> Recipes:
        """List the recipes with their states."""

        def read() -> Recipes:
            standings, problems = self._store.read()
            rows = tuple(_row(standing) for standing in standings)
            return Recipes(
                rows=rows,
                problems=problems,
                editable=self._editable,
                folder=str(self._folder),
                own_folder=str(self._own_folder),
            )

        return await self._worker.do(read)

    async def recipe(self, request: GetRecipe) -> RecipeView:
        """Return one recipe's file, or one of its revisions."""

        def read() -> RecipeView:
            row = _row(self._store.state(request.name))
            if request.revision is None:
                file = self._store.valid_file(request.name)
                text, recipe = file.text, file.recipe
            else:
                revision = self._store.revision(request.name, request.revision)
                text, recipe = revision.text, _recipe(revision)
            return RecipeView(row=row, text=text, values=recipe.model_dump(mode="json"))

        return await self._worker.do(read)

    async def history(self, request: GetRecipeHistory) -> RecipeHistory:
        """Return a page of a recipe's revisions."""

        def read() -> RecipeHistory:
            self._store.state(request.name)
            known = self._store.history(request.name)
            below = request.below or known[-1].revision + 1 if known else 1
            chosen = [place for place, each in enumerate(known) if each.revision < below][::-1]
            told = tuple(_revision(known[place], known[place - 1] if place else None) for place in chosen[:_REVISIONS])
            more = len(chosen) > _REVISIONS
            return RecipeHistory(revisions=told, below=told[-1].revision if more else None)

        return await self._worker.do(read)

    async def compare(self, request: CompareRecipe) -> Changes:
        """Return the differences between two forms of a recipe."""

        def read() -> Changes:
            standing = self._store.state(request.name)
            if request.old is not None:
                old = _recipe(self._store.revision(request.name, request.old))
            elif standing.control is not None:
                old = standing.control.recipe
            else:
                raise BadInputError(messages.NONE_APPROVED(recipe=request.name))
            new = self._store.valid_file(request.name).recipe
            if request.new is not None:
                new = _recipe(self._store.revision(request.name, request.new))
            return Changes(changes=_changes(old, new))

        return await self._worker.do(read)

    async def save_draft(self, request: SaveDraft) -> RecipeRow:
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

        return await self._change(request.name, save)

    async def submit(self, request: SubmitRecipe) -> RecipeRow:
        """Record the file as a draft."""
        person = _person(request.actor, request.reason)
        return await self._change(request.name, lambda: self._store.submit(request.name, person))

    async def approve(self, request: ApproveRecipe) -> RecipeRow:
        """Put a draft in force from the next lot on."""
        person = _person(request.actor, request.reason)
        return await self._change(request.name, lambda: self._store.approve(request.name, person, request.revision))

    async def reject(self, request: RejectRecipe) -> RecipeRow:
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

        return await self._change(request.name, reject)

    async def revert(self, request: RevertRecipe) -> RecipeRow:
        """Put a revision's text back into the file."""
        person = _person(request.actor, request.reason)
        return await self._change(request.name, lambda: self._editor.revert(request.name, person, request.revision))

    async def export(self, request: ExportRecipe) -> RecipeText:
        """Return a recipe's text, to be imported again."""
        return RecipeText(text=await self._worker.do(lambda: self._editor.export_text(request.name, request.revision)))

    async def import_text(self, request: ImportRecipe) -> RecipeRow:
        """Put a whole recipe in the place of its file."""
        person = _person(request.actor, request.reason)
        standing = await self._worker.do(lambda: self._editor.import_text(request.text, person, request.base))
        return _row(standing)

    async def past_curves(self, request: GetPastCurves) -> PastCurves:
        """Return the last judged curves of a recipe's fruit."""

        def read() -> PastCurves:
            recipe = self._store.valid_file(request.name).recipe
            with reading(self._records) as connection:
                ask = plain(connection).execute
                judged = ask(_JUDGED, (request.name, request.limit)).fetchall()
                return PastCurves(
                    curves=tuple(
                        _curve(number, outcome, onset_mm, ask(_POINTS, (number,)).fetchall(), recipe)
                        for number, outcome, onset_mm in judged
                    )
                )

        return await self._worker.do(read)

    async def start_whatif(self, request: StartWhatIf) -> JobView:
        """Judge stored inspections again by the recipe's file as it is now."""
        if not request.lot.isprintable():
            raise StationError(UNPRINTABLE(name=repr(request.lot)))
        folder = self._jobs.folder()
        draft = folder / f"{request.name}.yaml"

        def write() -> None:
            try:
                draft.write_text(self._store.valid_file(request.name).text, encoding="utf-8")
            except OSError as error:
                raise StationError(NOT_WRITTEN(file=str(draft), error=error.strerror or str(error))) from error

        await self._worker.do(write)
        lot = [f"--lots={request.lot}"] if request.lot else []
        arguments = ["whatif", "--recipe", str(draft), "--last", str(request.last), "--jobs", "1", *lot]
        return self._jobs.begin("whatif", folder, [*arguments, "--out", str(folder)], request.last)

    async def _change(self, name: str, work: Callable[[], object]) -> RecipeRow:
        def change() -> RecipeRow:
            work()
            return _row(self._store.state(name))

        return await self._worker.do(change)


def _row(standing: RecipeState) -> RecipeRow:
    control, file, waiting = standing.control, standing.file, standing.submitted
    known = control.recipe if control else file.recipe if file else None
    return RecipeRow(
        name=standing.name,
        title=known.title if known else standing.name,
        plc_number=known.plc_number if known else None,
        in_force=control.revision if control else None,
        file_state=standing.file_state.value,
        sha256=content_sha256(file.recipe) if file else "",
        waiting=waiting.revision if waiting else None,
        waiting_author=waiting.author if waiting else "",
        waiting_reason=waiting.reason if waiting else "",
        note=standing.note,
    )


def _revision(each: Revision, before: Revision | None) -> RevisionView:
    try:
        changes = () if before is None else _changes(before.recipe, each.recipe)
    except SettingsError:  # of a form that this program does not take any more
        changes = ()
    return RevisionView(
        revision=each.revision,
        status=each.status.value,
        origin=each.origin.value,
        sha256=each.sha256,
        author=each.author,
        reason=each.reason,
        created_utc_ms=each.created_utc_ms,
        approver=each.approver or "",
        approval_reason=each.approval_reason or "",
        approved_utc_ms=each.approved_utc_ms,
        retired_by=each.retired_by or "",
        retired_reason=each.retired_reason or "",
        retired_utc_ms=each.retired_utc_ms,
        changes=changes,
    )


def _recipe(revision: Revision) -> Recipe:
    try:
        return revision.recipe
    except SettingsError as error:
        raise BadInputError(messages.REVISION_NOT_ACCEPTED(why=message_of(error))) from error


def _changes(old: Recipe, new: Recipe) -> tuple[Change, ...]:
    return tuple(
        Change(path=each.path, old=_value_text(each.old), new=_value_text(each.new)) for each in differences(old, new)
    )


def _value_text(value: object) -> str:
    return shortened(value if isinstance(value, str) else json.dumps(value, ensure_ascii=False), _LONGEST_VALUE)


def _person(actor: Actor, reason: str) -> Person:
    return Person(actor.who, actor.role, reason)


def _curve(
    number: int, outcome: str, onset_mm: float | None, points: Sequence[tuple[Any, ...]], recipe: Recipe
) -> PastCurve:
    measured = tuple(
        Measured(closing_mm, area_mm2, area_px or 0, confidence, frozenset())
        for closing_mm, area_mm2, area_px, confidence in points
    )
    evidence = Evidence(Press(onset_mm, 0.0, measured, ()), SizedLimits(recipe)) if measured else None
    growths, needed = ((), ()) if evidence is None else (evidence.growths, evidence.needed)
    return PastCurve(
        sequence=number,
        outcome=outcome,
        closings_mm=tuple(point.closing_mm for point in measured),
        areas_mm2=tuple(point.area_mm2 for point in measured),
        growth_mm2_per_mm=max((growth.mm2_per_mm for growth in growths), default=None),
        onset_mm=onset_mm,
        confidence=needed[-1].confidence if needed else None,
    )

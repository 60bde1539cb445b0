"""Recipes page: state, editing as drafts with every limit drawn on past curves, approval by another person."""

import contextlib
import json
import re
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Depends, File, Form, Query, Request, UploadFile
from pydantic import StringConstraints, ValidationError
from starlette.responses import Response

from hmi.common.charts import area_over_closing
from hmi.past.past import RecordsError, Tried
from hmi.past.recipes import PastCurve, RecipeState, changes_of, recipe_of
from hmi.recipes.form import BadFieldError, changed, formatted, groups, with_changes
from hmi.recipes.strip import strip
from hmi.web.access import HmiNow, LocaleNow, caller_of, hmi_of, locale_of, orders
from hmi.web.context import Hmi
from hmi.web.gateway import SLOW_DEADLINE_S, actor_of
from hmi.web.navigation import Entry
from hmi.web.page import go_to, show, show_part
from hmi.web.problem import Problem
from hmi.web.roles import Right
from hmi.web.sessions import Caller
from hmi.web.translation import Locale
from station.channel.line import Noted
from station.channel.messages import DeadlineError, RefusedError
from station.channel.panel_recipes import (
    LARGEST_TEXT,
    ApproveRecipe,
    ImportedRecipe,
    ImportRecipe,
    RecipeOrder,
    RejectRecipe,
    RevertRecipe,
    SaveDraft,
    SubmitRecipe,
)
from station.charts.area_chart import Curve, Kind, Limit
from station.errors import BadInputError
from station.settings.recipe_model import Recipe
from station.settings.recipe_versions import content_sha256

router = APIRouter(prefix="/recipes")
ENTRY = Entry("recipes", "/recipes")
_OFTEN = re.compile(r"damage\.area\[\d+\]|damage|early_stop|expected_width")
"""Groups of values that are changed often; the others are folded."""
_SLIDES = re.compile(r"damage\.area\[\d+\]\.area_mm2")
"""Values that a slider beside the field moves too."""
_PREFIX = "v:"
"""Of a form's fields that are values of the recipe."""

Name = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_]{0,31}$")]
Reason = Annotated[str, Form(min_length=1, max_length=1000)]
Editor = Annotated[Caller, Depends(orders(Right.EDIT_RECIPES))]
Approver = Annotated[Caller, Depends(orders(Right.APPROVE_RECIPES))]


@router.get("")
async def recipes(request: Request, hmi: HmiNow) -> Response:
    """Show the state of all recipes."""
    return show(request, "recipes.html.j2", reply=await hmi.past.recipes.read())


@router.get("/{name}")
async def recipe(request: Request, hmi: HmiNow, locale: LocaleNow, name: Name) -> Response:
    """Show one recipe: the revision in force, the draft, the differences, the possible actions."""
    return await _recipe(request, hmi, locale, name)


async def _recipe(
    request: Request, hmi: Hmi, locale: Locale, name: str, unanswered: RecipeOrder | None = None
) -> Response:
    state = await _state(hmi, name)
    shown, problem = state.control.recipe if state.control else None, None
    if state.submitted:
        try:
            shown = recipe_of(state.submitted)
        except BadInputError as error:  # it is shown all the same, so that it can be rejected
            shown, problem = None, error.message
    new = shown if state.submitted else state.file.recipe if state.file else None
    changes = changes_of(state.control.recipe, new) if state.control and new else ()
    drawn = None if shown is None else await _drawn(hmi, locale, shown, shown.model_dump(mode="json"))
    # Carried out after all, an order leaves the page with another form, whose reason is another; so does a newer
    # revision, which this person has not seen yet.
    if isinstance(unanswered, ApproveRecipe | RejectRecipe):
        same_form = state.submitted is not None and state.submitted.revision == unanswered.revision
    else:
        same_form = state.submitted is None
    return show(
        request,
        "recipe.html.j2",
        status=503 if unanswered else 200,
        row=state,
        changes=changes,
        problem=problem,
        drawn=drawn,
        wrong=locale.text("problem.no_answer") if unanswered else "",
        reason=unanswered.reason if unanswered and same_form else "",
        tab="standing",
    )


@router.get("/{name}/edit")
async def edit(request: Request, hmi: HmiNow, locale: LocaleNow, name: Name) -> Response:
    """Show the form."""
    return await _form(request, hmi, locale, name, {})


@router.get("/{name}/chart")
async def chart(request: Request, hmi: HmiNow, locale: LocaleNow, name: Name) -> Response:
    """Render the chart with the typed limits; a field without a valid number keeps its stored value."""
    stored = (await _state(hmi, name)).valid_file.recipe
    values, typed = stored.model_dump(mode="json"), dict[str, Any]()
    for path, text in _typed(request.query_params).items():
        with contextlib.suppress(BadFieldError):
            typed |= changed(values, {path: text})
    drawn = await _drawn(hmi, locale, stored, with_changes(values, typed))
    return show_part(hmi, locale, "recipe_chart.html.j2", {"drawn": drawn})


@router.post("/{name}/draft")
async def save(
    request: Request, hmi: HmiNow, locale: LocaleNow, name: Name, caller: Editor, reason: Reason
) -> Response:
    """Save the typed values as a draft; errors are shown beside the form, which keeps the typed text."""
    form = await request.form()
    texts = {key: value for key, value in form.items() if isinstance(value, str)}
    values = (await _state(hmi, name)).valid_file.recipe.model_dump(mode="json")
    typed, base = _typed(texts), texts.get("base", "")
    try:
        changes = changed(values, typed)
    except BadFieldError as error:
        why = locale.text("recipes.bad_field", field=locale.own(error.field.key, error.field.title),
                           expected=locale.sentence(error.field.expected))  # fmt: skip
        return await _form(request, hmi, locale, name, typed, base, why, reason)
    if not changes:
        return await _form(request, hmi, locale, name, typed, base, locale.text("recipes.nothing_changed"), reason)
    try:
        query = SaveDraft(name=name, values=changes, base=base, reason=reason, actor=actor_of(caller))
        await hmi.gateway.request(query, Noted, deadline_s=SLOW_DEADLINE_S)
    except RefusedError as error:
        return await _form(request, hmi, locale, name, typed, base, locale.sentence(error.message), reason)
    except DeadlineError:
        return await _form(request, hmi, locale, name, typed, base, locale.text("problem.no_answer"), reason, 503)
    return go_to(f"/recipes/{name}")


@router.post("/{name}/submit")
async def submit(request: Request, name: Name, caller: Editor, reason: Reason) -> Response:
    """Record the edited file as a draft."""
    return await _order(request, SubmitRecipe(name=name, reason=reason, actor=actor_of(caller)))


@router.post("/{name}/approve")
async def approve(
    request: Request, name: Name, caller: Approver, reason: Reason, revision: Annotated[int, Form(ge=1, le=2**31)]
) -> Response:
    """Approve a draft."""
    return await _order(request, ApproveRecipe(name=name, revision=revision, reason=reason, actor=actor_of(caller)))


@router.post("/{name}/reject")
async def reject(
    request: Request, name: Name, caller: Approver, reason: Reason, revision: Annotated[int, Form(ge=1, le=2**31)]
) -> Response:
    """Reject a draft."""
    return await _order(request, RejectRecipe(name=name, revision=revision, reason=reason, actor=actor_of(caller)))


@router.post("/{name}/revert")
async def revert(
    request: Request,
    name: Name,
    caller: Editor,
    reason: Reason,
    revision: Annotated[int | None, Form(ge=1, le=2**31)] = None,
) -> Response:
    """Restore a revision's text in the file."""
    return await _order(request, RevertRecipe(name=name, revision=revision, reason=reason, actor=actor_of(caller)))


@router.get("/{name}/history")
async def history(
    request: Request, hmi: HmiNow, name: Name, below: Annotated[int | None, Query(ge=1, le=2**31)] = None
) -> Response:
    """Show the revisions: author, approver, dates, differences."""
    row, reply = await _state(hmi, name), await hmi.past.recipes.history(name, below)
    return show(request, "recipe_history.html.j2", row=row, reply=reply, tab="history")


@router.get("/{name}/text")
async def text(
    request: Request, hmi: HmiNow, name: Name, revision: Annotated[int | None, Query(ge=1, le=2**31)] = None
) -> Response:
    """Show the file's text, with its comments."""
    return await _text(request, hmi, name, revision)


async def _text(
    request: Request, hmi: Hmi, name: str, revision: int | None, wrong: str = "", reason: str = ""
) -> Response:
    row = await _state(hmi, name)
    text = row.valid_file.text if revision is None else (await hmi.past.recipes.revision(name, revision)).text
    return show(
        request,
        "recipe_text.html.j2",
        status=503 if wrong else 200,
        row=row,
        text=text,
        revision=revision,
        wrong=wrong,
        reason=reason,
        tab="text",
    )


@router.get("/{name}/export")
async def export(hmi: HmiNow, name: Name, revision: Annotated[int | None, Query(ge=1, le=2**31)] = None) -> Response:
    """Send the file, to be edited elsewhere and imported again."""
    text = await hmi.past.recipes.export_text(name, revision)
    headers = {"content-disposition": f'attachment; filename="{name}.yaml"'}
    return Response(text, media_type="application/yaml", headers=headers)


@router.post("/import")
async def import_file(hmi: HmiNow, caller: Editor, reason: Reason, file: Annotated[UploadFile, File()]) -> Response:
    """Replace the file by a whole recipe, and record it as a draft."""
    data = await file.read(LARGEST_TEXT + 1)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise Problem(400, "problem.bad_form") from None
    if not text or len(text) > LARGEST_TEXT:
        raise Problem(400, "problem.bad_form")
    order = ImportRecipe(text=text, reason=reason, actor=actor_of(caller))
    imported = await hmi.gateway.request(order, ImportedRecipe, deadline_s=SLOW_DEADLINE_S)
    return go_to(f"/recipes/{imported.name}")


@router.post("/{name}/whatif", dependencies=[Depends(orders(Right.EDIT_RECIPES))])
async def whatif(hmi: HmiNow, name: Name, last: Annotated[int, Form(ge=1, le=100_000)] = 500) -> Response:
    """Judge the latest fruit again by the file as it is."""
    text = (await _state(hmi, name)).valid_file.text
    folder = hmi.jobs.folder({f"{name}.yaml": text})
    arguments = ["whatif", "--recipe", str(folder / f"{name}.yaml"), "--last", str(last), "--jobs", "1"]
    job = hmi.jobs.begin("whatif", folder, [*arguments, "--out", str(folder)], last)
    return go_to(f"/jobs/{job.id}?back=/recipes/{name}")


async def _order(request: Request, order: RecipeOrder) -> Response:
    """Send an order; without an answer its page is shown again, with the typed reason."""
    hmi, locale = hmi_of(request), locale_of(request)
    try:
        await hmi.gateway.request(order, Noted, deadline_s=SLOW_DEADLINE_S)
    except DeadlineError:
        if isinstance(order, RevertRecipe) and order.revision is not None:
            wrong = locale.text("problem.no_answer")
            return await _text(request, hmi, order.name, order.revision, wrong, order.reason)
        return await _recipe(request, hmi, locale, order.name, order)
    return go_to(f"/recipes/{order.name}")


async def _form(
    request: Request,
    hmi: Hmi,
    locale: Locale,
    name: str,
    typed: Mapping[str, str],
    base: str = "",
    wrong: str = "",
    reason: str = "",
    status: int = 400,
) -> Response:
    known, row = await hmi.past.recipes.read(), await _state(hmi, name)
    stored = row.valid_file.recipe
    present = content_sha256(stored)
    base = base or present  # of the form that was opened: typed over a later version, its texts would undo that
    values = stored.model_dump(mode="json")
    made, sign = groups(values), locale.decimal_sign
    texts = {field.path: typed.get(field.path, formatted(field, sign)) for group in made for field in group.fields}
    return show(
        request,
        "recipe_edit.html.j2",
        status=status if wrong else 200,
        row=row,
        base=base,
        outdated=base != present,
        often=[each for each in made if _OFTEN.fullmatch(each.path)],
        rare=[each for each in made if not _OFTEN.fullmatch(each.path)],
        texts=texts,
        prefix=_PREFIX,
        slides=_SLIDES.fullmatch,
        wrong=wrong,
        reason=reason,
        drawn=await _drawn(hmi, locale, stored, values),
        title=lambda each: locale.own(each.key, each.title),
        reply=known,
        editable=known.editable and caller_of(request).may(Right.EDIT_RECIPES),
        tab="edit",
    )


def _typed(texts: Mapping[str, str]) -> dict[str, str]:
    return {key.removeprefix(_PREFIX): value for key, value in texts.items() if key.startswith(_PREFIX)}


async def _state(hmi: Hmi, name: str) -> RecipeState:
    found = next((each for each in (await hmi.past.recipes.read()).states if each.name == name), None)
    if found is None:
        raise Problem(404, "problem.not_found")
    return found


async def _drawn(hmi: Hmi, locale: Locale, recipe: Recipe, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the limits among the values, on past curves of the recipe; an empty result before the first inspection."""
    try:
        past = await hmi.past.recipes.curves(recipe)
    except RecordsError:  # there are none yet
        past = ()
    damage, early = values["damage"], values["early_stop"]
    limits = [Limit(each["closing_mm"], each["area_mm2"], each["least_area_mm2"]) for each in damage["area"]]
    curves = [Curve(_kind(each), each.points) for each in sorted(past, key=lambda each: each.outcome == "FAIL")]
    width, robust = values["expected_width"], values["segmentation"]["robust"]
    failed = sum(each.outcome == "FAIL" for each in past)
    label = locale.text("chart.recipe_label", n=len(past), failed=failed)
    return {
        "tried": await _tried(hmi, values),
        "number": len(past),
        "failed": failed,
        "area": area_over_closing(curves, limits, locale, label, early["area_mm2"]),
        "growth": strip(
            [(_kind(each), each.growth_mm2_per_mm) for each in past if each.growth_mm2_per_mm is not None],
            [("limit", damage["growth_mm2_per_mm"]), ("early", early["growth_mm2_per_mm"])],
        ),
        "width": strip(
            [(_kind(each), each.onset_mm) for each in past if each.onset_mm is not None],
            [("limit", width["smallest_mm"]), ("limit", width["largest_mm"])],
        ),
        "confidence": strip(
            [(_kind(each), each.confidence) for each in past if each.confidence is not None],
            [("limit", robust["least_confidence"])],
        ),
    }


async def _tried(hmi: Hmi, values: Mapping[str, Any]) -> Tried | Literal["invalid"] | None:
    """Return what these values would have decided; None before the first inspection."""
    try:
        draft = Recipe.model_validate_json(json.dumps(values))
    except ValidationError:  # two fields that do not fit each other: one of them is still to be typed
        return "invalid"
    try:
        return await hmi.past.tried(draft)
    except RecordsError:  # there are none yet
        return None


def _kind(curve: PastCurve) -> Kind:
    return "pass" if curve.outcome == "PASS" else "fail"

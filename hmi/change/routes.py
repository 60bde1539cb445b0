"""Change fruit page: select, review the differences, confirm, and follow the change between fruits."""

from collections.abc import Mapping
from typing import Annotated, Any, NamedTuple

from fastapi import APIRouter, Depends, Form, Path, Request
from starlette.responses import Response

from hmi.web.access import HmiNow, LocaleNow, orders
from hmi.web.context import Hmi
from hmi.web.gateway import ORDER_DEADLINE_S, Gateway, actor_of
from hmi.web.live import Part, of_state
from hmi.web.navigation import Entry
from hmi.web.page import go_to, show, show_part
from hmi.web.problem import Problem
from hmi.web.roles import Right
from hmi.web.sessions import Caller
from hmi.web.translation import NO_VALUE, Locale
from station.channel.panel_run import (
    GetRecipes,
    OperatorCommand,
    OperatorCommandName,
    OperatorCommandView,
    Recipes,
    RecipeSummary,
)
from station.settings.recipe_model import Recipe

router = APIRouter()
ENTRY = Entry("change", "/change")


class Change(NamedTuple):
    """One difference."""

    key: str
    """`change.field.KEY` of the catalogue."""
    now: str
    then: str


def _order_values(gateway: Gateway, _: Locale) -> Mapping[str, Any]:
    state = gateway.state
    given = state.orders if state else ()
    order = next((each for each in given if each.order is OperatorCommandName.CHOOSE_RECIPE), None)
    return {"state": state, "order": order}


_ORDER = of_state(
    lambda state: (state.orders, state.ready, state.why_not_ready, state.check_due, state.recipe, state.busy)
)
PARTS = {"change.order": Part("change_order.html.j2", _ORDER, _order_values)}


@router.get("/change")
async def change(request: Request, hmi: HmiNow) -> Response:
    """Show the fruit to select from."""
    return show(request, "change.html.j2", **await _tiles(hmi))


@router.get("/change/part")
async def tiles_part(hmi: HmiNow, locale: LocaleNow) -> Response:
    """Render the same as a part, for polling: the active recipe changes while the page is open."""
    return show_part(hmi, locale, "change_tiles.html.j2", await _tiles(hmi))


@router.get("/change/progress")
async def progress(request: Request) -> Response:
    """Show the progress of the change."""
    return show(request, "change_progress.html.j2")


@router.get("/change/{number}")
async def confirm(
    request: Request, hmi: HmiNow, locale: LocaleNow, number: Annotated[int, Path(ge=1, le=65_535)]
) -> Response:
    """Show the differences from the active recipe."""
    return show(request, "change_confirm.html.j2", **await _differences(hmi, locale, number))


@router.get("/change/{number}/part")
async def confirm_part(hmi: HmiNow, locale: LocaleNow, number: Annotated[int, Path(ge=1, le=65_535)]) -> Response:
    """Render the differences as a part; the page reloads itself when another recipe becomes active."""
    values = await _differences(hmi, locale, number)
    return show_part(hmi, locale, "change_what.html.j2", values, {"x-state": values["from_recipe"]})


@router.post("/change")
async def carry_out(
    hmi: HmiNow,
    caller: Annotated[Caller, Depends(orders(Right.CHANGE_FRUIT))],
    number: Annotated[int, Form(ge=1, le=65_535)],
) -> Response:
    """Change the fruit in the same way as the PLC's command."""
    request = OperatorCommand(person=actor_of(caller), order=OperatorCommandName.CHOOSE_RECIPE, argument=str(number))
    await hmi.gateway.request(request, OperatorCommandView, deadline_s=ORDER_DEADLINE_S)
    return go_to("/change/progress")


async def _tiles(hmi: Hmi) -> dict[str, Any]:
    found = await hmi.gateway.request(GetRecipes(), Recipes)
    fruit = [each for each in found.recipes if each.name != hmi.ball_recipe]
    return {"recipes": fruit, "active": found.active, "problems": found.problems}


async def _differences(hmi: Hmi, locale: Locale, number: int) -> dict[str, Any]:
    found = await hmi.gateway.request(GetRecipes(), Recipes)
    chosen = next((each for each in found.recipes if each.number == number), None)
    if chosen is None:
        raise Problem(404, "change.gone")
    active = found.active
    return {
        "chosen": chosen,
        "active": active,
        "changes": changes(active, chosen, locale),
        "from_recipe": "none" if active is None else f"{active.number} revision {active.revision}",
    }


def changes(now: RecipeSummary | None, then: RecipeSummary, locale: Locale) -> list[Change]:
    """Return the differences that matter at the line, from the active to the selected recipe; all if none is active."""
    before, after = {} if now is None else _values(now, locale), _values(then, locale)
    lines = [Change(key, before.get(key, NO_VALUE), value) for key, value in after.items()]
    return [line for line in lines if line.now != line.then]


def _values(shown: RecipeSummary, w: Locale) -> dict[str, str]:
    try:
        recipe = Recipe.model_validate_json(shown.values)
    except ValueError:  # of a schema version that this program does not accept
        return {"revision": shown.revision}
    width, steps, damage = recipe.expected_width, recipe.steps, recipe.damage
    limits = ", ".join(f"{w.number(a.area_mm2)} mm² ({w.number(a.closing_mm, 1)} mm)" for a in damage.area)
    return {
        "width": f"{w.number(width.smallest_mm)} … {w.number(width.largest_mm)} mm",
        "steps": f"{steps.number} × {w.number(steps.step_mm, 1)} mm",  # noqa: RUF001 (what is shown)
        "force": f"{w.number(recipe.gripper.force_n)} N",
        "speed": f"{w.number(recipe.gripper.speed_mm_s)} mm/s",
        "settle": f"{w.number(recipe.imaging.settle_s, 2)} s",
        "limits": limits,
        "growth": f"{w.number(damage.growth_mm2_per_mm)} mm²/mm",
        "early_stop": f"{w.number(recipe.early_stop.area_mm2)} mm²",
        "method": recipe.segmentation.method,
        "revision": shown.revision or NO_VALUE,
    }

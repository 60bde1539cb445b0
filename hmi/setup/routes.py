"""Set-up page: what is done from a fresh installation to the first fruit, what is next, what it waits for."""

from collections.abc import Mapping
from typing import Any

from fastapi import APIRouter, Depends, Request
from starlette.responses import Response

from hmi.setup.steps import first_fruit, steps
from hmi.web.access import may
from hmi.web.gateway import Gateway
from hmi.web.live import Part
from hmi.web.page import show
from hmi.web.roles import Right
from hmi.web.translation import Locale

router = APIRouter(prefix="/maintenance/setup")

_CONFIGURATION = ("/maintenance/configuration", "configuration.tab")
_HEALTH = ("/maintenance", "maintenance.tab_health")
_RUN = ("/", "nav.run")
LINKS = {
    "gripper": (_CONFIGURATION, _HEALTH, _RUN),
    "arm": (_CONFIGURATION, _HEALTH, _RUN),
    "camera": (_CONFIGURATION, _HEALTH),
    "plc": (_CONFIGURATION, ("/maintenance/registers", "maintenance.tab_registers")),
    "poses": (_CONFIGURATION,),
    "zero": (("/maintenance/hand", "maintenance.tab_hand"), _CONFIGURATION),
    "calibration": (("/maintenance/sensor", "maintenance.tab_sensor"),),
    "reference": (("/maintenance/image", "maintenance.tab_image"),),
    "recipe": (("/change", "nav.change"), ("/recipes", "nav.recipes")),
    "first": (_RUN, ("/maintenance/hand", "maintenance.tab_hand")),
}
"""Where each step is done, with the text of its link."""


def _depends_on(gateway: Gateway) -> object:
    state = gateway.state
    if state is None:
        return None
    return steps(state, gateway.recent), state.setup, state.recipe


def _values(gateway: Gateway, _: Locale) -> Mapping[str, Any]:
    state = gateway.state
    if state is None:
        return {"state": None}
    return {
        "state": state,
        "steps": steps(state, gateway.recent),
        "first": first_fruit(state, gateway.recent),
        "links": LINKS,
    }


PARTS = {"setup.steps": Part("setup_steps.html.j2", _depends_on, _values)}


@router.get("", dependencies=[Depends(may(Right.CONFIGURE))])
async def setup(request: Request) -> Response:
    """Show the steps."""
    return show(request, "setup.html.j2", tab="setup")

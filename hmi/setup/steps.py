"""Steps of the first set-up, decided from the station's state and its latest fruit, never by a person's tick."""

from collections.abc import Iterator
from typing import Literal, NamedTuple

from station.channel.panel_run import FruitSummary, PanelState, Recent
from station.messages.message import Message

DEVICES = ("gripper", "arm", "camera")
"""In the order in which they are found."""
_NEEDS = {
    "zero": ("gripper",),
    "calibration": ("gripper", "camera"),
    "reference": ("calibration",),
    "first": (*DEVICES, "plc", "poses", "calibration", "recipe"),
}
"""Steps without which another cannot be done; those not listed need none."""


class Step(NamedTuple):
    """One step."""

    name: str
    """Its title is `setup.step.NAME` of the catalogue, what to do `setup.how.NAME`."""
    state: Literal["done", "next", "open", "blocked"]
    """`next` is the first that can be done now, `open` are the others."""
    waits_for: tuple[str, ...]
    """Steps to do before; empty unless blocked."""
    message: Message | None
    """The station's own message and remedy while it is not done, or what it knows of it."""


def steps(state: PanelState, recent: Recent) -> tuple[Step, ...]:
    """Return all steps, in the order in which they are done."""
    found = tuple(_found(state, recent))
    left = [name for name, done, _ in found if not done]
    waiting = {name: tuple(each for each in _NEEDS.get(name, ()) if each in left) for name in left}
    first_open = next((name for name in left if not waiting[name]), None)
    return tuple(
        Step(
            name,
            "done" if done else "blocked" if waiting[name] else "next" if name == first_open else "open",
            waiting.get(name, ()),
            message,
        )
        for name, done, message in found
    )


def _found(state: PanelState, recent: Recent) -> Iterator[tuple[str, bool, Message | None]]:
    """Yield each step's name, whether it is done, and what the station says of it."""
    setup, faults = state.setup, {device.name: device.fault for device in state.devices}
    for name in DEVICES:
        if name in faults:
            yield name, faults[name] is None, faults[name]
    yield "plc", state.plc_connected and state.plc_alive and state.line_trouble is None, state.line_trouble
    if "arm" in faults:
        yield "poses", setup.poses_taught, None
    yield "zero", setup.zero_mm is not None, None
    yield "calibration", setup.calibration is not None and state.check_due is None, state.check_due or setup.calibration
    yield "reference", setup.has_reference, None
    yield "recipe", state.recipe is not None and state.recipe.name != setup.ball_recipe, None
    yield "first", first_fruit(state, recent) is not None, state.why_not_ready


def first_fruit(state: PanelState, recent: Recent) -> FruitSummary | None:
    """Return the oldest of the latest fruit whose contact was measured; None if there is none."""
    measured = (each for each in recent.fruit[::-1] if each.area_mm2 is not None)
    return next((each for each in measured if each.recipe != state.setup.ball_recipe), None)

"""A calibration at the panel, as a person with the ball starts it, answers it and ends it."""

from typing import Any

from station.channel.client import ChannelClient
from station.channel.panel import Actor
from station.channel.panel_maintenance import (
    CalibrationRunView,
    CalibrationState,
    EndCalibrationRun,
    GetCalibration,
    StartCalibrationRun,
)
from station.channel.panel_run import (
    GetPanelState,
    OperatorCommand,
    OperatorCommandName,
    OperatorCommandView,
    PanelState,
)
from tests.eventually import until

MAX = Actor(who="Max", role="maintenance")
PLACES = ((-2.5, 0.0),)
"""A second one, at which the run waits for the person."""
PRESSED_S = 240.0
"""Longest wait for a whole press of the ball, on a busy machine."""


async def give(panel: ChannelClient, name: OperatorCommandName, argument: str = "") -> OperatorCommandView:
    """An order, to its end: the first answer may come before."""
    order = OperatorCommand(person=MAX, order=name, argument=argument)
    given = await panel.request(order, OperatorCommandView, deadline_s=20)

    async def ended() -> OperatorCommandView | None:
        orders = (await panel.request(GetPanelState(), PanelState, deadline_s=20)).orders
        return next((each for each in orders if each.ticket == given.ticket and each.state != "executing"), None)

    return await until(ended)


async def stop(panel: ChannelClient) -> None:
    """*Stop*."""
    assert (await give(panel, OperatorCommandName.STOP)).state == "done"


async def start_run(panel: ChannelClient, places: tuple[tuple[float, float], ...] = PLACES) -> None:
    """*Calibrate*."""
    request = StartCalibrationRun(kind="calibration", places=places, actor=MAX)
    await panel.request(request, CalibrationRunView, deadline_s=20)


async def run_now(panel: ChannelClient) -> CalibrationRunView:
    """The run as the page shows it."""
    run = (await panel.request(GetCalibration(), CalibrationState, deadline_s=20)).run
    assert run is not None
    return run


async def until_waits(cell: Any, panel: ChannelClient) -> None:
    """Wait until the run has pressed the ball, and the person lays it at another place: hands are in the cell."""

    async def waits() -> bool:
        run = await run_now(panel)
        assert run.state in {"running", "waiting"}, run
        return run.state == "waiting"

    await cell.until(waits, PRESSED_S)


async def end_run(panel: ChannelClient) -> CalibrationRunView:
    """*Call it off*."""
    return await panel.request(EndCalibrationRun(actor=MAX), CalibrationRunView, deadline_s=60)

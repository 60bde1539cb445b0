"""Devices, ball and operator for `station calibrate` and `station verify`."""

import asyncio
import contextlib
import os
import sys
import termios
from collections.abc import AsyncIterator

import click
import cv2

from station.calibration.errors import CalibrationError
from station.calibration.rig import Place, Progress, Unit
from station.commands.signals import on_end_signals
from station.devices.arm.ur import ARM_READY_S, UrArm
from station.devices.camera.open import camera_from
from station.devices.gripper.interface import Gripper
from station.devices.gripper.robotiq import make_gripper
from station.errors import BadInputError
from station.records.database import records_folder
from station.records.errors import LockedError
from station.records.open import lock_folder
from station.runtime.devices.calibration_rig import CalibrationRig
from station.runtime.devices.rig import Cell, renewed_lease
from station.settings.configuration import Configuration
from station.settings.recipe import find_recipe
from station.settings.recipe_model import Recipe


@contextlib.asynccontextmanager
async def open_rig(
    site: Configuration, *, bench: bool, yes: bool
) -> AsyncIterator[tuple[CalibrationRig, Unit, Recipe]]:
    """Open the devices that the site names, for this program alone.

    Args:
        bench: leave the arm out, as the site's own setting does.
        yes: do not wait for the operator.

    Raises:
        CalibrationError: the station runs and has the devices open.
        BadInputError: the camera has no serial number.
        StationError: a device's fault.
    """
    recipe = find_recipe(site.calibration.recipe, site.recipes_folder)
    cv2.setNumThreads(max(1, (os.cpu_count() or 1) - 1))

    async def lay(place: Place) -> None:
        if not yes:
            where = (
                f"{place.x_mm:g} mm to the right and {place.y_mm:g} mm down, as the image shows it, of its first place"
            )
            await wait_for_enter(f"lay the ball {where}, then press Enter")

    async with contextlib.AsyncExitStack() as stack:
        stack.callback(os.close, lock_devices(site))
        camera = camera_from(site.camera)
        stack.push_async_callback(camera.close)
        await camera.open()
        description = camera.description
        if not description.serial:
            raise BadInputError(f"camera.driver: {description.name} is no sensor that could be calibrated")
        gripper = make_gripper(site.gripper)
        stack.push_async_callback(gripper.close)
        arm = None
        if not (bench or site.service.bench):
            arm = await stack.enter_async_context(UrArm(site.arm))
            await arm.ready(ARM_READY_S * site.service.patience)
            await stack.enter_async_context(renewed_lease(arm))

        async def activate() -> None:
            if yes:  # else it was, with empty jaws, and the ball may be between them by now
                await gripper.activate()

        if not yes:
            await activate_emptied(gripper)
            ball = f"the {site.calibration.ball_mm:g} mm ball lies in its holder"
            await wait_for_enter(
                f"the jaws will move: see that the gel is clean, {ball}, and hands are away; then press Enter"
            )
        unit = Unit(description.serial, description.name, simulated=site.camera.driver != "digit")
        cell = Cell(camera, gripper, arm)
        yield CalibrationRig(cell, recipe, lay, activate, site.service.patience), unit, recipe


async def wait_for_enter(request: str) -> None:
    """Wait for a person's Enter; Ctrl-C ends the wait, and the end of the input cancels the run."""
    if sys.stdin.isatty():
        termios.tcflush(sys.stdin, termios.TCIFLUSH)  # an Enter from before the request is no answer to it
    click.echo(request)
    loop, line = asyncio.get_running_loop(), asyncio.Event()
    try:
        loop.add_reader(sys.stdin, line.set)
    except PermissionError:  # a file, which is never waited for
        line.set()
    try:
        await line.wait()
    finally:
        loop.remove_reader(sys.stdin)
    if not sys.stdin.readline():
        raise asyncio.CancelledError


async def activate_emptied(gripper: Gripper) -> bool:
    """Activate a gripper that needs it once a person has emptied its jaws; return whether it did."""
    if not (await gripper.read()).needs_activation:
        return False
    await wait_for_enter(
        "the gripper is not activated, and its jaws will travel their whole way: take out what is between them, see "
        "that hands are away; then press Enter"
    )
    await gripper.activate()
    return True


def lock_devices(site: Configuration) -> int:
    """Take the lock that a station has while it runs; closing the descriptor releases it.

    Raises:
        CalibrationError: a station runs, or another program has the devices.
    """
    try:
        return lock_folder(records_folder(site.home))
    except LockedError as error:
        raise CalibrationError(
            f"the devices are in use ({error.cause}): stop the station, do this, and start it again"
        ) from error


def cancelled_by_signals() -> None:
    """Let Ctrl-C, and the signal that ends a service, cancel the calling task."""
    task = asyncio.current_task()
    assert task is not None  # noqa: S101 (called from a coroutine)
    on_end_signals(task.cancel)


def show(progress: Progress) -> None:
    """Print a procedure's progress."""
    count = f"{progress.number:2}/{progress.of}" if progress.of > 1 else ""
    click.echo(f"{progress.title!s:28}{count:8}{progress.detail or ''}".rstrip())

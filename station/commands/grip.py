"""`station grip`: one grip, its frames and widths written for `station analyze`."""

import asyncio
import contextlib
import csv
import os
from collections.abc import Sequence
from io import StringIO
from pathlib import Path

import click
import cv2
import numpy as np
import numpy.typing as npt

from station.commands.calibration_rig import activate_emptied, lock_devices, wait_for_enter
from station.commands.signals import on_end_signals
from station.config_option import config_option
from station.devices.arm.ur import ARM_READY_S, UrArm
from station.devices.camera.interface import Camera, Image
from station.devices.camera.open import camera_from
from station.devices.camera.twin import TwinCamera
from station.devices.gripper.robotiq import make_gripper
from station.errors import BadInputError
from station.press.measurement import PressMeasurement
from station.press.procedure import press
from station.press.rig import MeasuredStep, Step
from station.runtime.devices.rig import Cell, DeviceRig, renewed_lease
from station.settings.configuration import Configuration, load_configuration
from station.settings.recipe import find_recipe
from station.settings.recipe_model import Recipe
from station.vision.median import median_image
from station.vision.methods import make_method

_COLUMNS = ("image", "width_mm", "commanded_width_mm", "object_state", "current_a", "captured_s")


@click.command("grip")
@click.option("--recipe", "recipe_name", required=True, metavar="NAME", help="Recipe, by name or file.")
@click.option("--out", required=True, type=click.Path(path_type=Path), help="Folder for the frames; must not exist.")
@config_option
@click.option("--bench", is_flag=True, help="No arm: the fruit is already between the fingers.")
@click.option("--yes", is_flag=True, help="Do not ask: a gripper that is not activated may travel its whole way.")
def grip(
    recipe_name: str,
    out: Path,
    config: Path | None,
    bench: bool,  # noqa: FBT001 (click passes arguments by name)
    yes: bool,  # noqa: FBT001
) -> None:
    """Grip one fruit by a recipe's width steps, without a judgement. The arm and the gripper move.

    The station must not run meanwhile. Writes reference/, frames/ and widths.csv with the measured widths, and truth/
    with the twin's camera.
    """
    configuration = load_configuration(config)
    recipe = find_recipe(recipe_name, configuration.recipes_folder)
    recording = _Recording(out)
    try:
        asyncio.run(_grip(configuration, recipe, recording, bench=bench, yes=yes))
    except asyncio.CancelledError:
        raise click.Abort from None
    click.echo(
        f"{recording.count} images in {out}; measure them with:\n"
        f"station analyze --recipe {recipe_name} --reference {out / 'reference'} --widths {out / 'widths.csv'} "
        f"--out {out / 'report'} {out / 'frames'}"
    )


async def _grip(
    configuration: Configuration, recipe: Recipe, recording: "_Recording", *, bench: bool, yes: bool
) -> None:
    called_off = _cancelled_by_signal()
    async with contextlib.AsyncExitStack() as stack:
        stack.callback(os.close, lock_devices(configuration))
        camera = camera_from(configuration.camera)
        stack.push_async_callback(camera.close)
        await camera.open()
        gripper = make_gripper(configuration.gripper)
        stack.push_async_callback(gripper.close)
        arm = None
        if not (bench or configuration.service.bench):
            arm = await stack.enter_async_context(UrArm(configuration.arm))
            await arm.ready(ARM_READY_S)

        async with renewed_lease(arm):
            while not yes and await activate_emptied(gripper):  # it may lose its power again while a person is there
                await wait_for_enter("put the fruit in its place, take your hands away; then press Enter")
            await press(DeviceRig(Cell(camera, gripper, arm), recipe), recipe, _Observer(recipe, camera, recording))
    if called_off.is_set():  # too late to be cut short
        raise asyncio.CancelledError


def _cancelled_by_signal() -> asyncio.Event:
    """Let Ctrl-C, and the signal that ends a service, cancel the calling task and set the event."""
    called_off = asyncio.Event()
    task = asyncio.current_task()

    def call_off() -> None:
        called_off.set()
        if task is not None:
            task.cancel()

    on_end_signals(call_off)
    return called_off


class _Observer:
    """Writes every step, and finds the contact onset by the recipe's method."""

    def __init__(self, recipe: Recipe, camera: Camera, recording: "_Recording") -> None:
        self._recipe, self._camera, self._recording = recipe, camera, recording
        self._measurement: PressMeasurement | None = None

    async def see_reference(self, untouched: Step) -> None:
        self._recording.add_references(untouched.images)
        segmentation = self._recipe.segmentation
        method = await asyncio.to_thread(make_method, median_image(untouched.images), segmentation)
        self._measurement = PressMeasurement(method)

    async def measure(self, step: Step) -> MeasuredStep:
        assert self._measurement is not None  # noqa: S101 (the reference comes first)
        return await asyncio.to_thread(self._measurement.measure, step)

    async def see_step(self, step: Step) -> bool:
        twin = self._camera if isinstance(self._camera, TwinCamera) else None
        frame = step.last_frame
        mask = await twin.true_mask(frame.sequence, frame.image.shape) if twin is not None else None
        self._recording.add(step, mask)
        touched = "approach" if step.number < 0 else f"step {step.number}"
        click.echo(f"{touched:9} width {step.move.width_mm:6.2f} mm  {step.move.state}")
        return True


class _Recording:
    """Folder of one grip; written steps remain, also where a later one fails."""

    def __init__(self, folder: Path) -> None:
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise BadInputError(f"{folder}: is there already and not empty; name a new folder with --out")
        self._folder = folder
        self._rows: list[tuple[object, ...]] = []

    @property
    def count(self) -> int:
        """Return the number of written steps."""
        return len(self._rows)

    def add_references(self, references: Sequence[Image]) -> None:
        """Write the reference frames: images with nothing touching the gel."""
        for number, image in enumerate(references):
            self._write(f"reference/reference_{number}.png", image)

    def add(self, step: Step, mask: npt.NDArray[np.uint8] | None) -> None:
        """Write a step: picture, true mask if known, shape (height, width), 0 or 255, and a row of the table."""
        name = f"step_{len(self._rows):02d}.png"
        self._write(f"frames/{name}", step.image)
        if mask is not None:
            self._write(f"truth/{name}", mask)
        move = step.move
        self._rows.append(
            (
                name,
                f"{move.width_mm:.3f}",
                "" if move.requested_mm is None else f"{move.requested_mm:.3f}",
                move.state,
                "" if move.current_a is None else f"{move.current_a:.2f}",
                f"{step.last_frame.captured_s:.4f}",
            )
        )
        text = StringIO(newline="")
        csv.writer(text).writerows([_COLUMNS, *self._rows])
        self._write_bytes("widths.csv", text.getvalue().encode())

    def _write(self, name: str, picture: npt.NDArray[np.uint8]) -> None:
        self._write_bytes(name, cv2.imencode(".png", picture)[1].tobytes())

    def _write_bytes(self, name: str, data: bytes) -> None:
        path = self._folder / name
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
        except OSError as error:
            raise BadInputError(
                f"{path}: cannot be written: {error.strerror}; free space or name another --out"
            ) from error

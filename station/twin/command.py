"""`station twin`: the simulated world from the command line."""

import asyncio
import csv
from io import StringIO
from pathlib import Path
from typing import Literal

import click
import cv2
import numpy as np
import numpy.typing as npt

from station.errors import BadInputError
from station.settings.configuration import load_configuration
from station.twin.console import ask
from station.twin.damage import Severity
from station.twin.digit.press import render_press
from station.twin.fruit import Kind
from station.twin.gel import MM_PER_PX
from station.twin.process import CONSOLE_PORT, LOOPBACK, Twin, TwinOptions, run

FRUIT = click.Choice([kind.value for kind in Kind])
_OPEN_STEPS = 2


SEED = click.IntRange(0, 2**31 - 1)
PORT = click.IntRange(0, 65535)


@click.group("twin", invoke_without_command=True)
@click.option("--fruit", type=FRUIT, default=Kind.STRAWBERRY.value, show_default=True, help="What lies in the nest.")
@click.option("--seed", type=SEED, default=1, show_default=True, help="Which fruit, and the sensor's noise.")
@click.option(
    "--mm-per-px",
    type=click.FloatRange(0.02, 0.04),
    default=MM_PER_PX,
    show_default=True,
    help="The sensor's scale.",
)
@click.option("--bench", is_flag=True, help="No arm: the fruit is always between the fingers.")
@click.option("--polyscope", type=click.Choice(["5.22", "5.25"]), default="5.22", show_default=True, help="Version.")
@click.option("--config", type=click.Path(path_type=Path), metavar="FILE", help="Listen where this station.yaml looks.")
@click.option("--console", "console_port", type=PORT, default=CONSOLE_PORT, show_default=True, help="Console's port.")
@click.pass_context
def twin(
    context: click.Context,
    fruit: str,
    seed: int,
    mm_per_px: float,
    bench: bool,  # noqa: FBT001 (click passes arguments by name)
    polyscope: Literal["5.22", "5.25"],
    config: Path | None,
    console_port: int,
) -> None:
    """Run the simulated arm, gripper, sensor, fruit and line until Ctrl-C, or talk to the one that runs."""
    if context.invoked_subcommand is not None:
        return
    site = load_configuration(config)
    options = TwinOptions(
        fruit=Kind(fruit),
        seed=seed,
        mm_per_px=mm_per_px,
        bench=bench,
        arm=site.arm,
        gripper=site.gripper,
        camera=site.camera.twin,
        can=site.can,
        console_port=console_port,
        polyscope=polyscope,
    )
    asyncio.run(run(options, lambda running: _announce(options, running)))


def _announce(options: TwinOptions, running: Twin) -> None:
    urcap, rtu = options.gripper.urcap, options.gripper.modbus_rtu
    if not options.bench:
        click.echo(f"arm      {options.arm.host}, on a UR controller's own ports")
    click.echo(f"gripper  {urcap.host}:{urcap.port} (URCap), {rtu.host}:{rtu.port} (Modbus RTU over TCP)")
    click.echo(f"camera   {options.camera.host}:{running.camera.port}")
    if options.can.enabled:
        nodes = f"gate {options.can.gate_node}, encoder {options.can.encoder_node}"
        click.echo(f"line     CAN {options.can.interface} {options.can.channel}: {nodes}")
    click.echo(f"console  {LOOPBACK}:{running.console.address[1]}: station twin fault, station twin lay")
    click.echo("running; Ctrl-C ends it")


CONSOLE = click.option(
    "--console", default=CONSOLE_PORT, show_default=True, type=click.IntRange(1, 65535), help="Port."
)


@twin.command("fault")
@click.argument("device", required=False)
@click.argument("fault", required=False)
@click.option("--amount", type=float, default=1.0, show_default=True, help="Strength, in the fault's own unit.")
@click.option("--clear", is_flag=True, help="Switch off the fault, or all of the device's.")
@CONSOLE
def fault_command(device: str | None, fault: str | None, amount: float, clear: bool, console: int) -> None:  # noqa: FBT001
    """Switch a fault of a device on or off; without a DEVICE, list what is on, without a FAULT, what there is."""
    if device is None:
        state = ask(LOOPBACK, console, {"do": "list"})
        for name, active in state.items():
            click.echo(f"{name}: {', '.join(f'{fault} {amount:g}' for fault, amount in active.items()) or 'sound'}")
        return
    if fault is None and not clear:
        click.echo("\n".join(ask(LOOPBACK, console, {"do": "known", "device": device})))
        return
    request = {"do": "clear" if clear else "set", "device": device, "fault": fault, "amount": amount}
    active = ask(LOOPBACK, console, request)
    click.echo(f"{device}: {', '.join(f'{name} {value:g}' for name, value in active.items()) or 'sound'}")


@twin.command("lay")
@click.argument("fruit", type=FRUIT)
@click.option("--seed", type=SEED, default=1, show_default=True, help="Which fruit of its kind.")
@click.option("--bruised", is_flag=True, help="A damaged one.")
@click.option(
    "--severity", type=click.Choice([each.value for each in Severity]), default=Severity.SEVERE.value,
    show_default=True, help="How a bruised one is damaged.",
)  # fmt: skip
@click.option("--x-mm", type=float, default=0.0, help="Right of the gel's middle, as the image shows it.")
@click.option("--y-mm", type=float, default=0.0, help="Below it.")
@CONSOLE
def lay(
    fruit: str,
    seed: int,
    bruised: bool,  # noqa: FBT001
    severity: str,
    x_mm: float,
    y_mm: float,
    console: int,
) -> None:
    """Lay another fruit into the running twin's nest."""
    damage = {"bruised": bruised, "severity": severity}
    request = {"do": "fruit", "kind": fruit, "seed": seed, **damage, "x_mm": x_mm, "y_mm": y_mm}
    click.echo(ask(LOOPBACK, console, request))


@twin.command("press")
@click.option("--fruit", type=FRUIT, default=Kind.STRAWBERRY.value, show_default=True, help="What is pressed.")
@click.option("--seed", type=SEED, default=1, show_default=True, help="Which fruit, and the sensor's noise.")
@click.option("--steps", type=click.IntRange(1, 40), default=12, show_default=True, help="Images after first contact.")
@click.option("--step-mm", type=click.FloatRange(0.1, 5), default=1.0, show_default=True, help="Closing per image.")
@click.option("--out", required=True, type=click.Path(path_type=Path), help="Folder for the images; must not exist.")
def press(fruit: str, seed: int, steps: int, step_mm: float, out: Path) -> None:
    """Press a fruit without a gripper: images, widths and true masks, as `station analyze` reads them.

    Writes reference/, frames/, truth/ and widths.csv. The first two images show the gel untouched.
    """
    try:
        for name in ("reference", "frames", "truth"):
            (out / name).mkdir(parents=True)
    except OSError as error:
        raise BadInputError(f"{out}: cannot be made: {error.strerror}; name a new folder") from error
    closings_mm = [step_mm * (step + 1 - _OPEN_STEPS) for step in range(steps + _OPEN_STEPS)]
    sequence = render_press(fruit, seed, closings_mm)
    for number, image in enumerate(sequence.references):
        _write_picture(out / "reference" / f"reference_{number}.png", image)
    table = StringIO(newline="")
    writer = csv.writer(table)
    writer.writerow(("image", "width_mm"))
    for number, (image, mask, width_mm) in enumerate(
        zip(sequence.frames, sequence.true_masks, sequence.widths_mm, strict=True)
    ):
        name = f"step_{number:02d}.png"
        _write_picture(out / "frames" / name, image)
        _write_picture(out / "truth" / name, mask)
        writer.writerow((name, f"{width_mm:.2f}"))
    _write(out / "widths.csv", table.getvalue().encode())
    click.echo(f"{len(sequence.frames)} images of a {fruit} in {out}")


def _write_picture(path: Path, picture: npt.NDArray[np.uint8]) -> None:
    _write(path, cv2.imencode(".png", picture)[1].tobytes())


def _write(path: Path, data: bytes) -> None:
    try:
        path.write_bytes(data)
    except OSError as error:
        raise BadInputError(
            f"{path}: cannot be written: {error.strerror}; free space and name a new folder with --out"
        ) from error

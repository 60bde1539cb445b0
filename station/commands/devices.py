"""`station devices`: what answers at the devices' addresses."""

import asyncio
from pathlib import Path

import click

from station.devices.arm.probe import probe_arm
from station.devices.camera.probe import probe_camera
from station.devices.finding import Finding
from station.devices.gripper.probe import probe_gripper
from station.errors import StationError
from station.settings.configuration import Configuration, load_configuration

_COLOURS = {"ok": "green", "warning": "yellow", "fault": "red"}


@click.group("devices")
def devices() -> None:
    """Look at the station's devices."""


@devices.command("check")
@click.option("--config", type=click.Path(path_type=Path), metavar="FILE", help="The station.yaml to use.")
@click.option("--bench", is_flag=True, help="No arm.")
def check(config: Path | None, bench: bool) -> None:  # noqa: FBT001 (click passes arguments by name)
    """Ask every device who it is and how it does; nothing is moved.

    Says for each what was found, a verdict, and what to do. The exit code is 1 where a device is faulty.
    """
    findings = asyncio.run(_look(load_configuration(config), bench=bench))
    for finding in findings:
        verdict = click.style(f"{finding.verdict:8}", fg=_COLOURS[finding.verdict])
        click.echo(f"{verdict}{finding.device:16}{finding.found}")
        if finding.remedy:
            click.echo(f"{'':24}{finding.remedy}")
    faulty = sorted({finding.device for finding in findings if finding.verdict == "fault"})
    if faulty:
        raise StationError(f"not usable: {', '.join(faulty)}")


async def _look(configuration: Configuration, *, bench: bool) -> list[Finding]:
    others = asyncio.gather(probe_gripper(configuration.gripper), probe_camera(configuration.camera))
    arm = [] if bench else await probe_arm(configuration.arm)
    return [*arm, *(finding for found in await others for finding in found)]

"""`station devices`: check the devices, and recover the arm."""

import asyncio
import contextlib
from pathlib import Path
from typing import get_args

import click

from station.channel.client import ChannelClient
from station.channel.line import CommandDone
from station.channel.messages import DeadlineError
from station.channel.panel import AlarmList, ListAlarms, Recover, RecoveryName
from station.commands.site import site_or_last_good
from station.config_option import config_option
from station.devices.arm.faults import ArmFault
from station.devices.arm.probe import probe_arm
from station.devices.arm.ur import ARM_READY_S, UrArm
from station.devices.camera.probe import probe_camera
from station.devices.check_result import CheckResult
from station.devices.gripper.probe import probe_gripper
from station.errors import StationError
from station.settings.configuration import Configuration, load_configuration
from station.settings.plc import line_endpoint

_LEASE_S = 60.0
_STATION_DEADLINE_S = 3.0
_COLOURS = {"ok": "green", "warning": "yellow", "fault": "red"}


@click.group("devices")
def devices() -> None:
    """Check the station's devices, and recover the arm after a stop."""


@devices.command("check")
@config_option
@click.option("--bench", is_flag=True, help="No arm.")
def check(config: Path | None, bench: bool) -> None:  # noqa: FBT001 (click passes arguments by name)
    """Check every device's identity and state; nothing is moved.

    Prints for each the finding, a verdict, and what to do. The exit code is 1 if a device is faulty.
    """
    findings = asyncio.run(_check_devices(load_configuration(config), bench=bench))
    for finding in findings:
        verdict = click.style(f"{finding.verdict:8}", fg=_COLOURS[finding.verdict])
        click.echo(f"{verdict}{finding.device:16}{finding.found}")
        if finding.remedy:
            click.echo(f"{'':24}{finding.remedy}")
    faulty = sorted({finding.device for finding in findings if finding.verdict == "fault"})
    if faulty:
        raise StationError(f"not usable: {', '.join(faulty)}")


@devices.command("recover")
@click.argument("what", type=click.Choice(get_args(RecoveryName)))
@config_option
@click.option("--yes", is_flag=True, help="Do not ask: a person has looked.")
def recover(what: RecoveryName, config: Path | None, yes: bool) -> None:  # noqa: FBT001
    """Recover the arm after a stop, once a person has checked the cell.

    protective-stop: confirm it and start the program again; power: power on and release the brakes, after an
    emergency stop too; program: upload it again, after the pendant stopped it or took local control.
    """
    if not yes:
        click.confirm("Is the cause found, and nobody at the arm?", abort=True)
    asyncio.run(_recover(site_or_last_good(config), what))
    click.echo("the arm is ready")


async def _recover(configuration: Configuration, what: RecoveryName) -> None:
    if not await _recovered_by_the_station(configuration, what):
        await _recover_alone(configuration, what)


async def _recovered_by_the_station(configuration: Configuration, what: RecoveryName) -> bool:
    """Request the recovery from the station, which has the arm's registers while it runs; False if none runs."""
    endpoint = line_endpoint(configuration.handshake, configuration.home)
    async with ChannelClient(endpoint, "the station") as station:
        try:
            # Answered from memory, also while the records cannot be opened.
            await station.request(ListAlarms(), AlarmList, deadline_s=_STATION_DEADLINE_S)
        except DeadlineError:
            return False
        deadline_s = configuration.arm.recovery_deadline_s + _STATION_DEADLINE_S
        done = await station.request(Recover(what=what), CommandDone, deadline_s=deadline_s)
    if not done.done:
        raise StationError(done.why or "")
    return True


async def _recover_alone(configuration: Configuration, what: RecoveryName) -> None:
    async with UrArm(configuration.arm) as arm:
        with contextlib.suppress(ArmFault):  # being not ready is what brings a person here
            await arm.ready(ARM_READY_S)
        arm.renew_health(_LEASE_S)
        match what:
            case "protective-stop":
                await arm.confirm_protective_stop()
            case "power":
                await arm.power_on_and_release_brakes()
            case _:
                await arm.upload_again()
        await arm.ready(ARM_READY_S)


async def _check_devices(configuration: Configuration, *, bench: bool) -> list[CheckResult]:
    others = asyncio.gather(probe_gripper(configuration.gripper), probe_camera(configuration.camera))
    arm = [] if bench else await probe_arm(configuration.arm)
    return [*arm, *(finding for found in await others for finding in found)]

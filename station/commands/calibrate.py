"""`station calibrate`: calibrate the sensor on its gripper with a ball of known size."""

import asyncio
import getpass
import logging
import os
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

import click

from station.calibration.calibration_procedure import CalibrationProcedure, Draft, Evidence
from station.calibration.errors import CalibrationError, RefusedError
from station.calibration.model import Check, Refusal, stamp
from station.calibration.report import refusal_files
from station.calibration.rig import Place, Unit
from station.calibration.store import PAGE, CalibrationStore
from station.commands.calibration_rig import cancelled_by_signals, lock_devices, open_rig, show
from station.commands.calibration_storage import store_calibration
from station.commands.simulated_unit import calibrate_simulated_unit
from station.config_option import config_option
from station.devices.camera.open import camera_from
from station.errors import BadInputError
from station.records.database import records_folder
from station.records.direct_transaction import direct_transaction
from station.runtime.devices.gel_change import store_gel_change
from station.settings.configuration import Configuration, load_configuration


class _PlaceType(click.ParamType):
    """Place of the ball, `x,y` in mm."""

    name = "x,y"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> Place:
        """Read a place."""
        if isinstance(value, Place):
            return value
        try:
            x_mm, y_mm = (float(part) for part in str(value).split(","))
        except ValueError:
            self.fail(f"expected two numbers of mm as 4,0, got {value!r}", param, ctx)
        if not (abs(x_mm) <= 10 and abs(y_mm) <= 10):
            self.fail(f"expected numbers from -10 to 10 mm, the gel ends there, got {value!r}", param, ctx)
        return Place(x_mm, y_mm)


@click.group("calibrate", invoke_without_command=True)
@click.option("--operator", default=getpass.getuser, show_default="the user", help="Who calibrates.")
@click.option(
    "--place",
    "places",
    type=_PlaceType(),
    multiple=True,
    metavar="X,Y",
    help="Also press the ball so many mm beside its first place, which measures the scale; may be repeated.",
)
@click.option("--bench", is_flag=True, help="No arm: the ball is held between the fingers.")
@click.option("--yes", is_flag=True, help="Do not ask: the ball lies there, and at each place when its turn comes.")
@config_option
@click.pass_context
def calibrate(
    context: click.Context,
    operator: str,
    places: tuple[Place, ...],
    bench: bool,  # noqa: FBT001 (click passes arguments by name)
    yes: bool,  # noqa: FBT001
    config: Path | None,
) -> None:
    """Calibrate the sensor with the rubber ball, and store the result. The gripper closes on the ball.

    The station must not run meanwhile. A result that fails a check is not stored as a calibration: the reasons are
    printed, and the folder of its pictures. Cancelled with Ctrl-C, nothing is stored.
    """
    if context.invoked_subcommand is not None:
        return
    site = load_configuration(config)
    draft = _run(site, operator, places, bench=bench, yes=yes)
    folder = store_calibration(site, operator, draft)
    _print_checks(draft.calibration.checks)
    click.echo(f"calibration {draft.calibration.summary()}")
    click.echo(f"stored; look at {folder / PAGE}")


def _store_refusal(site: Configuration, unit: Unit, operator: str, refused: RefusedError, evidence: Evidence) -> Path:
    """Store the pictures that show a person the reasons."""
    refusal = Refusal(
        id=stamp(datetime.now(UTC)),
        serial=unit.serial,
        unit=unit.name,
        operator=operator,
        reasons=refused.reasons,
        checks=evidence.checks,
        curve=tuple(step.point for step in evidence.steps),
    )
    return CalibrationStore(site.home).add_refusal(refusal, refusal_files(refusal, evidence))


def _run(site: Configuration, operator: str, places: tuple[Place, ...], *, bench: bool, yes: bool) -> Draft:
    async def run() -> Draft:
        cancelled_by_signals()
        async with open_rig(site, bench=bench, yes=yes) as (ball_bench, unit, recipe):
            procedure = CalibrationProcedure(
                ball_bench, unit, recipe, site.calibration, places, operator, version("fruit-station"), show
            )
            try:
                return await procedure.run()
            except RefusedError as refused:
                folder = _store_refusal(site, unit, operator, refused, procedure.evidence)
                raise CalibrationError(f"{refused}; look at {folder / PAGE}") from refused

    logging.basicConfig(format="station: %(message)s")
    try:
        return asyncio.run(run())
    except asyncio.CancelledError:
        raise click.Abort from None


def _print_checks(checks: tuple[Check, ...]) -> None:
    for check in checks:
        click.echo(f"{'good' if check.passed else 'FAIL':6}{check.name:12}{check.found}")


@calibrate.command("simulated")
@config_option
def simulated_command(config: Path | None) -> None:
    """Calibrate the twin's sensor if no calibration is in force, in a few seconds: on a drawn ball at three places.

    No device is used, so the station and the twin may run meanwhile. The ball is drawn at the twin's usual scale.
    """
    site = load_configuration(config)
    if site.camera.driver != "twin":
        raise BadInputError(
            f"camera.driver is {site.camera.driver}: only the twin's sensor is calibrated so; lay the ball in and run "
            "station calibrate"
        )
    made = calibrate_simulated_unit(site, getpass.getuser())
    click.echo(f"calibration {made.summary()}" if made else "it is calibrated already; see station calibrate list")


@calibrate.command("gel-changed")
@click.option("--operator", default=getpass.getuser, show_default="the user", help="Who changed the gel.")
@config_option
def gel_changed_command(operator: str, config: Path | None) -> None:
    """Note that the sensor's gel was changed: its calibrations measure no fruit any more, until the next one.

    The station must not run meanwhile; while it runs, use the button on the page Maintenance, Sensor.
    """
    site = load_configuration(config)
    serial = camera_from(site.camera).description.serial
    if not serial:
        raise BadInputError(f"camera.driver: {site.camera.driver} is no sensor that could be calibrated")
    os.close(lock_devices(site))  # given back at once: the transaction below may have to migrate the records
    with direct_transaction(records_folder(site.home)) as connection:
        old = store_gel_change(connection, site.home, serial, operator, "service")
    was = f"its calibration {old} is not in force any more" if old else "it had no calibration in force"
    click.echo(f"sensor {serial}: {was}; calibrate it with the new gel: station calibrate")


@calibrate.command("list")
@config_option
def list_command(config: Path | None) -> None:
    """List the calibrations of every unit, the newest first."""
    store = CalibrationStore(load_configuration(config).home)
    rows = [
        (serial, calibration, store.last_verification(calibration))
        for serial in store.serials()
        for calibration in store.calibrations(serial)
    ]
    if not rows:
        click.echo("nothing is calibrated yet; see station calibrate --help")
    for serial, calibration, verified in rows:
        state = "" if verified is None else f", verified {verified.id}: {'PASS' if verified.passed else 'FAIL'}"
        if store.is_of_earlier_gel(calibration):
            state += ", of an earlier gel: not in force"
        click.echo(f"{serial:16}{calibration.summary()}, by {calibration.operator}{state}")


@calibrate.command("show")
@click.argument("name", metavar="ID")
@config_option
def show_command(name: str, config: Path | None) -> None:
    """Show one calibration: its numbers, its checks, and the path of its page."""
    store = CalibrationStore(load_configuration(config).home)
    calibration = store.find(name)
    click.echo(f"{calibration.serial}, {calibration.unit}, by {calibration.operator}")
    click.echo(calibration.summary())
    click.echo(f"onset {calibration.onset_mm:.2f} mm, the gripper's zero is off by {calibration.zero_mm:+.2f} mm")
    _print_checks(calibration.checks)
    for verification in store.verifications(calibration.serial):
        if verification.calibration == calibration.id:
            verdict = "PASS" if verification.passed else "FAIL"
            click.echo(f"verified {verification.id}: {verdict}, {store.folder(verification) / PAGE}")
    click.echo(f"page {store.folder(calibration) / PAGE}")

"""`station verify`: verification of the sensor at the shift's start, with the ball."""

import asyncio
import getpass
import logging
from pathlib import Path

import click

from station.calibration.errors import CalibrationError
from station.calibration.model import Calibration
from station.calibration.store import PAGE, CalibrationStore
from station.calibration.verification_procedure import VerificationProcedure, VerificationResult
from station.commands.calibration_rig import cancelled_by_signals, open_rig, show
from station.commands.calibration_storage import store_verification
from station.config_option import config_option
from station.errors import StationError
from station.settings.configuration import Configuration, load_configuration


@click.command("verify")
@click.option("--operator", default=getpass.getuser, show_default="the user", help="Who verifies.")
@click.option("--bench", is_flag=True, help="No arm: the ball is held between the fingers.")
@click.option("--yes", is_flag=True, help="Do not ask: the ball lies there.")
@config_option
def verify(operator: str, bench: bool, yes: bool, config: Path | None) -> None:  # noqa: FBT001 (click's way)
    """Verify the sensor with the ball against its calibration: PASS or FAIL. The gripper closes on the ball.

    The station must not run meanwhile. Exit code 0 for PASS, 1 for FAIL; either is stored, with its pictures.
    """
    site = load_configuration(config)
    store = CalibrationStore(site.home)

    async def run() -> tuple[VerificationResult, Calibration]:
        cancelled_by_signals()
        async with open_rig(site, bench=bench, yes=yes) as (ball_bench, unit, recipe):
            calibration = _calibration(store, unit.serial, site)
            pictures = store.golden(calibration), store.presses(calibration)
            procedure = VerificationProcedure(
                ball_bench, recipe, site.calibration, calibration, *pictures, operator, show
            )
            return await procedure.run(), calibration

    logging.basicConfig(format="station: %(message)s")
    try:
        verified, calibration = asyncio.run(run())
    except asyncio.CancelledError:
        raise click.Abort from None
    verification, folder = verified.verification, store_verification(site, operator, verified, calibration)
    for check in verification.checks:
        click.echo(f"{'good' if check.passed else 'FAIL':6}{check.name:8}{check.found}, expected {check.expected}")
    click.echo(f"{'PASS' if verification.passed else 'FAIL'}; look at {folder / PAGE}")
    if bad := [check for check in verification.checks if not check.passed]:
        raise StationError("not verified: " + "; ".join(f"{check.name}: {check.remedy}" for check in bad))


def _calibration(store: CalibrationStore, serial: str, site: Configuration) -> Calibration:
    calibration = store.current(serial)
    if calibration is not None:
        return calibration
    if (changed := store.gel_change(serial)) is not None:
        raise CalibrationError(changed.words())
    others = ", ".join(store.serials())
    known = f"calibrated are: {others}: is this the right sensor? Else" if others else "nothing is calibrated yet:"
    raise CalibrationError(f"unit {serial} has no calibration in {site.home}; {known} run `station calibrate`")

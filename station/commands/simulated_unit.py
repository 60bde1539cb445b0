"""Calibration of the simulated sensor: the station's own procedure on a drawn ball, without the wire."""

import asyncio
from importlib.metadata import version

from station.calibration.calibration_procedure import CalibrationProcedure
from station.calibration.model import Calibration
from station.calibration.rig import Place, Unit
from station.calibration.store import CalibrationStore
from station.commands.calibration_storage import store_calibration
from station.devices.camera.twin import TwinCamera
from station.settings.configuration import Configuration
from station.settings.recipe import find_recipe
from station.studies.simulated_rig import SimulatedRig

PLACES = (Place(-2.5, 0.0), Place(0.0, 3.0))
"""Further places, as docs/calibration.md requires of a person: so the scale is measured."""


def calibrate_simulated_unit(site: Configuration, operator: str) -> Calibration | None:
    """Calibrate the twin's sensor if it has no calibration in force, in a few seconds; None if it has one.

    The ball is drawn as the twin draws it, at the gripper's counts and with the sensor's noise; arm, gripper and frames
    do not go over the wire, which would take minutes. All else is what `station calibrate` does and stores.

    Raises:
        StationError: it could not be stored, or the procedure refused the result.
    """
    camera = TwinCamera(site.camera).description
    if CalibrationStore(site.home).current(camera.serial) is not None:
        return None
    draft = asyncio.run(
        CalibrationProcedure(
            SimulatedRig(),
            Unit(camera.serial, camera.name, simulated=True),
            find_recipe(site.calibration.recipe, site.recipes_folder),
            site.calibration,
            PLACES,
            operator,
            version("fruit-station"),
            lambda _: None,
        ).run()
    )
    store_calibration(site, operator, draft)
    return draft.calibration

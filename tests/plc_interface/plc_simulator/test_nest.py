"""The simulated grader: what the PLC receives of the length of the fruit that the twin lays."""

import asyncio

import pytest

from plc_interface.plc_simulator.nest import GRADER_ERROR_MM, SEVERITIES, Grader, TwinNest
from station.settings.camera import TwinCameraSettings
from station.settings.gripper import GripperSettings
from station.twin.damage import DAMAGES, Severity
from station.twin.process import Twin, TwinOptions
from tests.hosts import fresh_host

RECIPES = {"strawberry": 1, "blueberry": 2}


def test_a_grader_errs_evenly_within_its_bounds_in_tenths():
    grader, again = Grader(7), Grader(7)
    lengths = [grader.length_mm_x10(45.44) for _ in range(2_000)]
    assert lengths == [again.length_mm_x10(45.44) for _ in range(2_000)]
    assert set(lengths) == set(range(444, 465)), "every tenth within ± 1 mm, and none beyond"
    assert GRADER_ERROR_MM == 1.0
    outer = sum(abs(length - 454.4) > 5 for length in lengths)
    assert 0.45 < outer / len(lengths) < 0.55, "half of them in the outer halves"


@pytest.mark.parametrize("graded", [True, False])
def test_the_length_is_of_the_fruit_that_the_twin_has_laid(graded, unused_port):
    host = fresh_host()
    gripper = GripperSettings.model_validate({"urcap": {"host": host}, "modbus_rtu": {"host": host}})
    camera = TwinCameraSettings(host=host, port=unused_port)

    async def main():
        twin = Twin(TwinOptions(bench=True, gripper=gripper, camera=camera, console_port=0))
        await twin.start()
        try:
            nest = TwinNest(twin.console.address[1], RECIPES, 0.5, 3, graded=graded, severity="mild")
            laid = []
            for _ in range(8):
                fruit = await nest.arrive()
                truth = twin.world.fruit
                assert truth
                laid.append((fruit, truth))
                await nest.leave()
            return laid
        finally:
            await twin.stop()

    laid = asyncio.run(main())
    assert {fruit.kind for fruit, _ in laid} == set(RECIPES)
    for fruit, truth in laid:
        assert (fruit.kind, fruit.damaged) == (truth.kind, truth.bruised)
        assert truth.damage == DAMAGES[Severity.MILD]
        if graded:
            assert abs(fruit.length_mm_x10 / 10 - truth.length_mm) <= GRADER_ERROR_MM + 0.05
        else:
            assert fruit.length_mm_x10 == 0
    assert [fruit.length_mm_x10 for fruit, _ in laid] != [round(10 * truth.length_mm) for _, truth in laid]


def test_the_line_names_the_severities_that_the_twin_knows():
    assert tuple(Severity) == SEVERITIES

"""Masters that were not written here, unmodified, against the twin."""

import asyncio
import logging
from collections.abc import Callable
from typing import Any

import pymodbus.client
import pyrobotiqgripper
import pytest
from pymodbus.framer import FramerType

from station.twin.robotiq.load import Spring

OnWire = Callable[..., Any]


def foreign_gripper(rig: Any) -> pyrobotiqgripper.RobotiqGripper:
    if rig.wire == "serial":
        return pyrobotiqgripper.RobotiqGripper(com_port=rig.server.path)
    return pyrobotiqgripper.RobotiqGripper(
        connection_type=pyrobotiqgripper.GRIPPER_MODE_RTU_VIA_TCP,
        tcp_host=rig.server.host,
        tcp_port=rig.server.port,
    )


@pytest.mark.parametrize("line", ["rtu over tcp", "serial"])
def test_pyrobotiqgripper_activates_calibrates_and_grips(on: OnWire, line: str):
    def use(rig: Any) -> None:
        gripper = foreign_gripper(rig)
        try:
            gripper.activate()
            assert gripper.isActivated()
            gripper.calibrate_mm(closemm=0, openmm=85)
            assert (gripper._openbit, gripper._closebit) == (3, 230)
            gripper.move_mm(60)
            assert gripper.position_mm() == pytest.approx(60.0, abs=0.4)
            assert rig.twin.opening_mm(rig.clock.now_s()) == pytest.approx(60.0, abs=0.4)
            rig.load(Spring(free_mm=50.0, stiffness_n_per_mm=100.0))
            gripper.close(speed=255, force=0)
            status = gripper.status()
            assert (status["gOBJ"], status["gFLT"], status["gPR"]) == (2, 0, 255)
            rig.faults.set("overcurrent")
            with pytest.raises(pyrobotiqgripper.GripperFaultError) as caught:
                gripper.readStatus()
            assert caught.value.code == 0xE
        finally:
            gripper.disconnect()
            logging.getLogger("pymodbus").setLevel(logging.NOTSET)

    async def scenario(rig: Any) -> None:
        await asyncio.to_thread(use, rig)

    on(line, scenario)


def test_a_bare_pymodbus_client_reads_and_writes_with_every_function(on: OnWire):
    async def scenario(rig: Any) -> None:
        client = pymodbus.client.AsyncModbusTcpClient(rig.server.host, port=rig.server.port, framer=FramerType.RTU)
        assert await client.connect()
        try:
            assert (await client.read_holding_registers(2000, count=3, device_id=9)).registers == [0x3100, 0, 0x0300]
            assert not (await client.write_registers(1000, [0x0900, 20, 0xFF00], device_id=9)).isError()
            assert (await client.read_input_registers(2001, count=1, device_id=9)).registers == [20]
            both = await client.readwrite_registers(
                read_address=2000, read_count=2, write_address=1001, values=[30], device_id=9
            )
            assert both.registers[1] == 30
            refused = await client.write_register(1001, 40, device_id=9)
            assert refused.exception_code == 1
        finally:
            client.close()

    on("rtu over tcp", scenario)


def test_two_masters_see_one_gripper(on: OnWire):
    async def scenario(rig: Any) -> None:
        client = pymodbus.client.AsyncModbusTcpClient(rig.server.host, port=rig.server.port, framer=FramerType.RTU)
        assert await client.connect()
        try:
            moving = asyncio.create_task(rig.driver.move_to_width(45.0, 100.0, 20.0))
            while not moving.done():
                assert (await client.read_input_registers(2000, count=3, device_id=9)).registers[0] & 0x3000 == 0x3000
            assert (await client.read_input_registers(2002, count=1, device_id=9)).registers[0] >> 8 == (
                (await moving).reading.position_count
            )
        finally:
            client.close()

    on("rtu over tcp", scenario)

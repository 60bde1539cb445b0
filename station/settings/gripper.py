"""Settings of the gripper: its wire, its fingers and its times."""

from typing import Literal, Self

from pydantic import model_validator

from station.messages import settings as messages
from station.settings.model import Settings, setting
from station.settings.network import Port
from station.settings.problems import FieldError


class GripperCalibration(Settings):
    """Position counts and millimetres of one set of fingers."""

    open_count: int = setting(
        3,
        title="Count when open",
        description="Position that the gripper reads when it is fully open; about 3 on a 2F-85.",
        ge=0,
        le=127,
    )
    closed_count: int = setting(
        230,
        title="Count when closed",
        description="Position that the gripper reads when its bare pads touch; about 230 on a 2F-85.",
        ge=128,
        le=255,
    )
    mm_per_count: float = setting(
        85 / 227,
        title="Millimetres per count",
        description="Change of the opening per count: the stroke of 85 mm over the counts from open to closed.",
        unit="mm",
        ge=0.1,
        le=1.0,
    )
    finger_offset_mm: float = setting(
        32.0,
        title="Taken by the fingers",
        description="Part of the opening that sensor and sponge take; with a DIGIT 32 mm of 85 mm, as in the paper.",
        unit="mm",
        ge=0.0,
        le=80.0,
    )

    @model_validator(mode="after")
    def _leaves_room(self) -> Self:
        stroke_mm = (self.closed_count - self.open_count) * self.mm_per_count
        if stroke_mm <= self.finger_offset_mm:
            expected = messages.NO_STROKE_LEFT(taken_mm=self.finger_offset_mm, stroke_mm=stroke_mm)
            raise FieldError([((), expected)])
        return self


class UrcapSettings(Settings):
    """The gripper on a UR's wrist, reached through Robotiq's URCap."""

    host: str = setting(
        "127.0.0.2",
        title="Robot's address",
        description="Name or address of the UR controller on which the URCap runs. The default is the twin.",
        min_length=1,
        max_length=253,
    )
    port: Port = setting(
        63352,
        title="URCap's port",
        description="TCP port of the URCap's socket; the URCap always uses 63352.",
    )


class ModbusRtuSettings(Settings):
    """The gripper on an RS-485 line, at a serial port or behind a gateway that carries RTU frames over TCP."""

    line: Literal["serial", "tcp"] = setting(
        "serial",
        title="Line",
        description="`serial` for an RS-485 adapter, `tcp` for RTU frames over TCP (RS-485 URCap, serial gateway).",
    )
    serial_port: str = setting(
        "/dev/ttyUSB0",
        title="Serial port",
        description="Device file of the RS-485 adapter; a path under /dev/serial/by-id does not change.",
        min_length=1,
        max_length=255,
    )
    baud_rate: int = setting(
        115_200,
        title="Baud rate",
        description="Bits per second of the serial port; the gripper leaves the factory with 115200, 8N1.",
        unit="baud",
        ge=1200,
        le=115_200,
    )
    host: str = setting(
        "127.0.0.2",
        title="Gateway's address",
        description="Name or address of what carries RTU frames over TCP. The default is the twin.",
        min_length=1,
        max_length=253,
    )
    port: Port = setting(
        54321,
        title="Gateway's port",
        description="TCP port of the gateway; the RS-485 URCap uses 54321.",
    )
    unit: int = setting(
        9,
        title="Unit",
        description="Modbus unit of the gripper; 9 from the factory.",
        ge=1,
        le=247,
    )


class GripperSettings(Settings):
    """The Robotiq 2F-85."""

    driver: Literal["urcap", "modbus_rtu"] = setting(
        "urcap",
        title="Driver",
        description="`urcap` through the UR controller, `modbus_rtu` on the gripper's own RS-485 line.",
    )
    urcap: UrcapSettings = setting(
        UrcapSettings(),
        title="URCap",
        description="Used by the driver `urcap`.",
    )
    modbus_rtu: ModbusRtuSettings = setting(
        ModbusRtuSettings(),
        title="Modbus RTU",
        description="Used by the driver `modbus_rtu`.",
    )
    calibration: GripperCalibration = setting(
        GripperCalibration(),
        title="Finger set",
        description="Counts and millimetres of the fingers that are mounted.",
    )
    opening_speed_mm_s: float = setting(
        100.0,
        title="Opening speed",
        description="Speed at which the gripper is opened to let go.",
        unit="mm/s",
        ge=20.0,
        le=150.0,
    )
    answer_timeout_s: float = setting(
        0.25,
        title="Answer time-out",
        description="Longest wait for one answer; a healthy gripper needs about 5 ms.",
        unit="s",
        ge=0.02,
        le=5.0,
    )
    move_margin_s: float = setting(
        1.0,
        title="Margin of a move",
        description="What a move may take beyond its travel at the asked speed before it counts as failed.",
        unit="s",
        ge=0.1,
        le=10.0,
    )
    activation_timeout_s: float = setting(
        10.0,
        title="Activation time-out",
        description="Longest wait for an activation, in which the fingers travel their whole way twice.",
        unit="s",
        ge=1.0,
        le=60.0,
    )

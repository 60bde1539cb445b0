"""The RTDE outputs: which there are, of which type, and where their values come from.

Names and types: RTDE guide, table "Robot controller outputs".
"""

import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from station.twin.ur.registers import COUNT
from station.twin.ur.script import RuntimeState

if TYPE_CHECKING:  # the controller makes these itself
    from station.twin.ur.controller import UrController

Getter = Callable[[], tuple[Any, ...]]
"""Source of an RTDE output's value, one element for each of its numbers."""
JOINT_RUNNING, JOINT_POWER_OFF = 253, 239
_REGISTER = re.compile(r"(input|output)_(int|double|bit)_register_(\d{1,3})")
_ZEROS = {
    ("VECTOR6D", (0.0,) * 6): """
        target_qdd target_current target_moment actual_current actual_current_window joint_control_output
        actual_TCP_force ft_raw_wrench wrench_calc_from_currents payload_inertia
    """,
    ("VECTOR3D", (0.0,) * 3): "elbow_position elbow_velocity",
    ("DOUBLE", (0.0,)): """
        actual_momentum actual_robot_energy_consumed actual_robot_braking_energy_dissipated
        standard_analog_input0 standard_analog_input1 euromap67_24V_voltage euromap67_24V_current
        tool_analog_input0 tool_analog_input1 tcp_force_scalar joint_position_deviation_ratio
        collision_detection_ratio
    """,
    ("UINT32", (0,)): "euromap67_input_bits euromap67_output_bits tool_analog_input_types script_control_line",
    ("INT32", (0,)): "encoder0_raw encoder1_raw",
}
"""Names of outputs that read as zero, by their type and value."""
_CONSTANT: dict[str, tuple[str, tuple[float, ...]]] = {
    **{name: zero for zero, names in _ZEROS.items() for name in names.split()},
    "actual_digital_input_bits": ("UINT64", (0,)),
    "joint_temperatures": ("VECTOR6D", (28.0,) * 6),
    "actual_execution_time": ("DOUBLE", (0.0005,)),
    "actual_tool_accelerometer": ("VECTOR3D", (0.0, 0.0, -9.82)),
    "actual_main_voltage": ("DOUBLE", (48.0,)),
    "io_current": ("DOUBLE", (0.03,)),
    "tool_mode": ("UINT32", (253,)),
    "tool_output_voltage": ("INT32", (24,)),
    "tool_output_current": ("DOUBLE", (0.1,)),
    "tool_temperature": ("DOUBLE", (30.0,)),
    "tool_output_mode": ("UINT8", (0,)),
    "tool_digital_output0_mode": ("UINT8", (1,)),
    "tool_digital_output1_mode": ("UINT8", (1,)),
    "time_scale_source": ("INT32", (-1,)),
    "target_gravity": ("VECTOR3D", (0.0, 0.0, 9.82)),
}
"""What the twin does not model: type, and a constant, believable value."""


def output(controller: "UrController", name: str) -> tuple[str, Getter] | None:
    """RTDE type and source of an output; None where this version of the controller has none of that name."""
    if (match := _REGISTER.fullmatch(name)) is not None:
        return _register(controller, name, match[1], match[2], int(match[3]))
    return controller.outputs.get(name)


def _register(controller: "UrController", name: str, way: str, kind: str, number: int) -> tuple[str, Getter] | None:
    """Return the type and source of one register; an input is read back as it was written."""
    registers = controller.registers
    if not (64 <= number <= 127 if kind == "bit" else number < COUNT):
        return None
    rtde_type = {"int": "INT32", "double": "DOUBLE", "bit": "BOOL"}[kind]
    if way == "input":
        return rtde_type, lambda: (registers.inputs.get(name, 0),)
    if kind == "bit":
        return rtde_type, lambda: (False,)
    values = registers.output_int if kind == "int" else registers.output_double
    return rtde_type, lambda: (values[number],)


def output_table(controller: "UrController") -> dict[str, tuple[str, Getter]]:
    """Every output but the registers, by name: its RTDE type and its source."""
    body, safety, script = controller.body, controller.safety, controller.script

    io, inputs = controller.inputs_outputs, controller.registers.inputs

    def same(values: tuple[float, ...]) -> Getter:
        return lambda: values

    table: dict[str, tuple[str, Getter]] = {
        **{name: (kind, same(values)) for name, (kind, values) in _CONSTANT.items()},
        "timestamp": ("DOUBLE", lambda: (controller.uptime_s,)),
        "target_q": ("VECTOR6D", lambda: body.joints_rad),
        "target_qd": ("VECTOR6D", lambda: body.speeds_rad_s),
        "actual_q": ("VECTOR6D", controller.measured_joints_rad),
        "actual_qd": ("VECTOR6D", lambda: body.speeds_rad_s),
        "actual_TCP_pose": ("VECTOR6D", body.tool_pose),
        "actual_TCP_speed": ("VECTOR6D", body.tool_speed),
        "target_TCP_pose": ("VECTOR6D", body.tool_pose),
        "target_TCP_speed": ("VECTOR6D", body.tool_speed),
        "robot_mode": ("INT32", lambda: (safety.robot_mode.value,)),
        "joint_mode": ("VECTOR6INT32", lambda: (JOINT_RUNNING if safety.powered else JOINT_POWER_OFF,) * 6),
        "safety_mode": ("INT32", lambda: (safety.safety_mode.value,)),
        "safety_status": ("INT32", lambda: (safety.safety_mode.value,)),
        "speed_scaling": ("DOUBLE", lambda: (controller.speed_scaling,)),
        "target_speed_fraction": ("DOUBLE", lambda: (controller.speed_slider,)),
        "actual_robot_voltage": ("DOUBLE", lambda: (48.0 if safety.powered else 0.0,)),
        "actual_robot_current": ("DOUBLE", lambda: (0.7 if safety.powered else 0.0,)),
        "actual_joint_voltage": ("VECTOR6D", lambda: (48.0 if safety.powered else 0.0,) * 6),
        "actual_digital_output_bits": ("UINT64", lambda: (io.digital_bits,)),
        "runtime_state": ("UINT32", lambda: (script.runtime_state.value,)),
        "robot_status_bits": (
            "UINT32",
            # RTDE guide: bit 0 for power on, bit 1 for a program that runs.
            lambda: (safety.powered | (script.runtime_state is RuntimeState.PLAYING) << 1,),
        ),
        "safety_status_bits": ("UINT32", lambda: (safety.bits,)),
        "tcp_offset": ("VECTOR6D", lambda: body.tcp_offset),
        "analog_io_types": ("UINT32", lambda: (io.analog_types,)),
        "standard_analog_output0": ("DOUBLE", lambda: (io.analog_output(0),)),
        "standard_analog_output1": ("DOUBLE", lambda: (io.analog_output(1),)),
        "output_bit_registers0_to_31": ("UINT32", lambda: (0,)),
        "output_bit_registers32_to_63": ("UINT32", lambda: (0,)),
        "input_bit_registers0_to_31": ("UINT32", lambda: (inputs.get("input_bit_registers0_to_31", 0),)),
        "input_bit_registers32_to_63": ("UINT32", lambda: (inputs.get("input_bit_registers32_to_63", 0),)),
        "payload": ("DOUBLE", lambda: (script.payload_kg,)),
        "payload_cog": ("VECTOR3D", lambda: script.payload_cog_m),
    }
    if controller.polyscope >= (5, 23):
        table["actual_current_as_torque"] = ("VECTOR6D", same((0.0,) * 6))
    return table

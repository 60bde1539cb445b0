"""The RTDE outputs: which there are, of which type, and where their values come from.

Names and types: RTDE guide, table "Robot controller outputs". What the twin does not model (currents, temperatures,
voltages, forces) has a constant, believable value.
"""

import re

from station.twin.ur.interface import Controller, Getter
from station.twin.ur.registers import COUNT
from station.twin.ur.script import RuntimeState

JOINT_RUNNING, JOINT_POWER_OFF = 253, 239
_REGISTER = re.compile(r"output_(int|double)_register_(\d{1,2})")


def output(controller: Controller, name: str) -> tuple[str, Getter] | None:
    """RTDE type and source of an output; None where this version of the controller has none of that name."""
    match = _REGISTER.fullmatch(name)
    if match is not None and int(match[2]) < COUNT:
        number = int(match[2])
        if match[1] == "int":
            return "INT32", lambda: (controller.registers.output_int[number],)
        return "DOUBLE", lambda: (controller.registers.output_double[number],)
    return controller.outputs.get(name)


def output_table(controller: Controller) -> dict[str, tuple[str, Getter]]:
    """Every output but the registers, by name: its RTDE type and its source."""
    body, safety, script = controller.body, controller.safety, controller.script

    def constant(*values: float) -> Getter:
        return lambda: values

    six_zeros = constant(*(0.0,) * 6)
    table: dict[str, tuple[str, Getter]] = {
        "timestamp": ("DOUBLE", lambda: (controller.uptime_s,)),
        "target_q": ("VECTOR6D", lambda: body.joints_rad),
        "target_qd": ("VECTOR6D", lambda: body.speeds_rad_s),
        "target_qdd": ("VECTOR6D", six_zeros),
        "target_current": ("VECTOR6D", six_zeros),
        "target_moment": ("VECTOR6D", six_zeros),
        "actual_q": ("VECTOR6D", controller.measured_joints_rad),
        "actual_qd": ("VECTOR6D", lambda: body.speeds_rad_s),
        "actual_current": ("VECTOR6D", six_zeros),
        "joint_control_output": ("VECTOR6D", six_zeros),
        "actual_TCP_pose": ("VECTOR6D", body.tool_pose),
        "actual_TCP_speed": ("VECTOR6D", body.tool_speed),
        "actual_TCP_force": ("VECTOR6D", six_zeros),
        "target_TCP_pose": ("VECTOR6D", body.tool_pose),
        "target_TCP_speed": ("VECTOR6D", body.tool_speed),
        "actual_digital_input_bits": ("UINT64", constant(0)),
        "joint_temperatures": ("VECTOR6D", constant(*(28.0,) * 6)),
        "actual_execution_time": ("DOUBLE", constant(0.0005)),
        "robot_mode": ("INT32", lambda: (safety.robot_mode.value,)),
        "joint_mode": ("VECTOR6INT32", lambda: (JOINT_RUNNING if safety.powered else JOINT_POWER_OFF,) * 6),
        "safety_mode": ("INT32", lambda: (safety.safety_mode.value,)),
        "safety_status": ("INT32", lambda: (safety.safety_mode.value,)),
        "actual_tool_accelerometer": ("VECTOR3D", constant(0.0, 0.0, -9.82)),
        "speed_scaling": ("DOUBLE", lambda: (controller.speed_scaling,)),
        "target_speed_fraction": ("DOUBLE", lambda: (controller.speed_slider,)),
        "actual_momentum": ("DOUBLE", constant(0.0)),
        "actual_main_voltage": ("DOUBLE", constant(48.0)),
        "actual_robot_voltage": ("DOUBLE", lambda: (48.0 if safety.powered else 0.0,)),
        "actual_robot_current": ("DOUBLE", lambda: (0.7 if safety.powered else 0.0,)),
        "actual_joint_voltage": ("VECTOR6D", lambda: (48.0 if safety.powered else 0.0,) * 6),
        "actual_digital_output_bits": ("UINT64", lambda: (controller.digital_outputs,)),
        "runtime_state": ("UINT32", lambda: (script.runtime_state.value,)),
        "standard_analog_input0": ("DOUBLE", constant(0.0)),
        "standard_analog_input1": ("DOUBLE", constant(0.0)),
        "standard_analog_output0": ("DOUBLE", constant(0.0)),
        "standard_analog_output1": ("DOUBLE", constant(0.0)),
        "robot_status_bits": (
            "UINT32",
            lambda: (safety.powered | (script.runtime_state is RuntimeState.PLAYING) << 1,),
        ),
        "safety_status_bits": ("UINT32", lambda: (safety.bits,)),
        "ft_raw_wrench": ("VECTOR6D", six_zeros),
        "payload": ("DOUBLE", lambda: (script.payload_kg,)),
        "payload_cog": ("VECTOR3D", lambda: script.payload_cog_m),
        "payload_inertia": ("VECTOR6D", six_zeros),
    }
    if controller.polyscope >= (5, 23):
        table["actual_current_as_torque"] = ("VECTOR6D", six_zeros)
    return table

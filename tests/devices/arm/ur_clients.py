"""Requests of other clients to a controller, as data: RTDE recipes, and dashboard commands with their answers.

Sources: Universal Robots' RTDE Python client, `examples/record_configuration.xml` (the recipe that `record.py` ships
with); Universal Robots' C++ client library, `resources/rtde_output_recipe.txt`.
"""

RECORD = (
    "timestamp, target_q, target_qd, target_qdd, target_current, target_moment, actual_q, actual_qd, "
    "actual_current, joint_control_output, actual_TCP_pose, actual_TCP_speed, actual_TCP_force, target_TCP_pose, "
    "target_TCP_speed, actual_digital_input_bits, joint_temperatures, actual_execution_time, robot_mode, "
    "joint_mode, safety_mode, actual_tool_accelerometer, speed_scaling, target_speed_fraction, actual_momentum, "
    "actual_main_voltage, actual_robot_voltage, actual_robot_current, actual_joint_voltage, "
    "actual_digital_output_bits, runtime_state, joint_position_deviation_ratio"
)

CLIENT_LIBRARY = (
    "timestamp, actual_q, actual_qd, speed_scaling, target_speed_fraction, runtime_state, actual_TCP_force, "
    "actual_TCP_pose, actual_digital_input_bits, actual_digital_output_bits, standard_analog_input0, "
    "standard_analog_input1, standard_analog_output0, standard_analog_output1, analog_io_types, tool_mode, "
    "tool_analog_input_types, tool_analog_input0, tool_analog_input1, tool_output_voltage, tool_output_current, "
    "tool_temperature, robot_mode, safety_mode, robot_status_bits, safety_status_bits, actual_current, tcp_offset"
)

DASHBOARD = {
    "load wait_program.urp": "File not found: wait_program.urp",
    "get operational mode": "NONE",
    "set operational mode automatic": "Setting operational mode: automatic",
    "set operational mode sideways": "Failed setting operational mode: sideways",
    "clear operational mode": "operational mode is no longer controlled by Dashboard Server",
    "isProgramSaved": "true <unnamed>",
    "generate support file /programs": "Completed successfully: /programs",
    "popup mind the fruit": "showing popup",
    "quit": "Disconnected",
}

"""The gripper: a small Protocol, and Robotiq's 2F-85 behind it over two wires."""

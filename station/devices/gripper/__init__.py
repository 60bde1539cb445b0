"""Gripper: its Protocol, and the driver of Robotiq's 2F-85 over two wires."""

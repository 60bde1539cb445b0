"""The twin's CANopen nodes beside the line: a reject gate and a line encoder."""

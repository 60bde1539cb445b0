"""The line's CAN: a reject gate and an encoder on CANopen, with the station as their master."""

"""Modbus TCP server: registers for the line's PLC."""

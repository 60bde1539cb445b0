"""The line PLC's view of the station over Modbus TCP."""

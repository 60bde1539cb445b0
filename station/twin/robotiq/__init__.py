"""The twin's Robotiq 2F-85: one register model, reached over the URCap's socket and over Modbus RTU."""

"""PLC simulator, for the demonstration and for commissioning a real station."""

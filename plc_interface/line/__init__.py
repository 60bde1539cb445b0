"""The line's side of the interface: a simulated PLC, for the demonstration and for commissioning a real station."""

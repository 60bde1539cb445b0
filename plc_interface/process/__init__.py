"""Process of the PLC interface: the handshake joined to registers, journal, station and outputs."""

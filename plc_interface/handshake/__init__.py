"""The handshake with the PLC as one pure state table: no I/O, no clock, no thread."""

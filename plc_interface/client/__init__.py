"""Client of the register map: the PLC's side of the handshake, for tests and integrators."""

from plc_interface.client.station_client import StationClient

__all__ = ["StationClient"]

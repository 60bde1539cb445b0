"""All links of one station, each through a proxy."""

import contextlib
import secrets
from collections.abc import AsyncIterator, Mapping
from enum import StrEnum

from station.settings.configuration import Configuration
from station.twin.ur import dashboard, primary, rtde
from station.twin.ur.network import SCRIPT_PORT

from .proxy import Link, Route


class LinkName(StrEnum):
    """The links of a station."""

    RTDE = "RTDE"
    SCRIPT = "script and dashboard"
    """The arm's other ports: scripts are sent there, and the dashboard is queried."""
    URCAP = "URCap"
    CAMERA = "camera"
    MODBUS = "Modbus"
    CHANNEL = "channel"
    """Between the PLC interface and the station."""


class Routes:
    """The links of one station: all on one address of their own, by the ports of what is behind."""

    def __init__(self) -> None:
        self.host = f"127.{112 + secrets.randbelow(16)}.{secrets.randbelow(250) + 1}.{secrets.randbelow(250) + 1}"
        """Where the station, and the line's PLC, find the other side."""
        self.links: Mapping[LinkName, Link] = {}

    @contextlib.asynccontextmanager
    async def opened(self, behind: Configuration, channel: tuple[str, int]) -> AsyncIterator[None]:
        """Listen, and close all at the end.

        Args:
            behind: with the devices' own addresses.
            channel: the station's own address of the line's channel.
        """
        arm, urcap, camera, modbus = behind.arm, behind.gripper.urcap, behind.camera.twin, behind.modbus
        routes = {
            LinkName.RTDE: (Route(arm.host, rtde.PORT),),
            LinkName.SCRIPT: tuple(Route(arm.host, port) for port in (dashboard.PORT, primary.PORT, SCRIPT_PORT)),
            LinkName.URCAP: (Route(urcap.host, urcap.port),),
            LinkName.CAMERA: (Route(camera.host, camera.port),),
            LinkName.MODBUS: (Route(modbus.host, modbus.port, station_dials=False),),
            LinkName.CHANNEL: (Route(*channel, station_dials=False),),
        }
        self.links = {name: Link(self.host, each) for name, each in routes.items()}
        async with contextlib.AsyncExitStack() as stack:
            for link in self.links.values():
                stack.push_async_callback(link.close)
                await link.open()
            yield

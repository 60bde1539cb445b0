"""A CAN bus on the twin's loop: no thread sends, and a node can be silenced."""

import asyncio
from collections.abc import Callable
from typing import Any

import can
import canopen

from station.settings.can import CanSettings

_RECEIVE_S = 0.05


class PeriodicTask:
    """Sends one frame again and again until it is stopped, as canopen's class of this name does from a thread."""

    def __init__(self, network: "LoopNetwork", can_id: int, data: bytes, period_s: float) -> None:
        self._network, self._can_id, self._data, self._period_s = network, can_id, data, period_s
        self._task = asyncio.get_running_loop().create_task(self._send(), name=f"twin CAN 0x{can_id:X}")

    async def _send(self) -> None:
        while True:
            self._network.send_message(self._can_id, self._data)
            await asyncio.sleep(self._period_s)

    def stop(self) -> None:
        """End it."""
        self._task.cancel()

    def update(self, data: bytes) -> None:
        """Send this from now on."""
        self._data = data


class LoopNetwork(canopen.Network):
    """canopen's network with its callbacks on the loop."""

    def __init__(self, settings: CanSettings, silent: Callable[[], bool]) -> None:
        """Prepare; nothing is opened. While `silent` returns True, nothing is sent or received."""
        super().__init__()
        self._settings, self._silent = settings, silent

    def open(self) -> None:
        """Open the bus.

        Raises:
            OSError: it cannot be had.
        """
        options: dict[str, Any] = (
            # With a hop limit of 0 no frame leaves this machine.
            {"port": self._settings.port, "hop_limit": 0, "fd": False}
            if self._settings.interface == "udp_multicast"
            else {}
        )
        try:
            # python-can's own configuration files are ignored: they could name another bus.
            self.bus = can.Bus(
                interface=self._settings.interface, channel=self._settings.channel, ignore_config=True, **options
            )
        except can.CanError as error:
            raise OSError(
                f"CAN {self._settings.interface} {self._settings.channel}: {error.__cause__ or error}"
            ) from error
        self.notifier = can.Notifier(self.bus, self.listeners, _RECEIVE_S, loop=asyncio.get_running_loop())

    def close(self) -> None:
        """Close the bus; waits for its thread where it has one."""
        if self.bus is not None:
            self.disconnect()

    def send_message(self, can_id: int, data: Any, remote: bool = False) -> None:  # noqa: FBT001, FBT002 (canopen's)
        """Send one frame, unless silent."""
        if self.bus is not None and not self._silent():
            super().send_message(can_id, bytes(data), remote)

    def send_periodic(self, can_id: int, data: Any, period: float, remote: bool = False) -> Any:  # noqa: FBT001, FBT002
        """Send one frame periodically; nothing here is remote."""
        return PeriodicTask(self, can_id, bytes(data), period)

    def notify(self, can_id: int, data: bytearray, timestamp: float) -> None:
        """Take one frame, unless silent."""
        if not self._silent():
            super().notify(can_id, data, timestamp)

    def report_bus_off(self) -> None:
        """Let the others' drivers see what Linux reports when a controller leaves the bus (linux/can/error.h).

        On a real bus each controller reports its own state; the simulated bus has none, so this frame represents it.
        """
        if self.bus is not None:
            self.bus.send(can.Message(arbitration_id=0x40, is_error_frame=True, is_extended_id=False, dlc=8))

"""Common part of both nodes: boot-up, NMT, error register and emergencies (CiA 301)."""

from pathlib import Path

import canopen

from station.twin.can.network import LoopNetwork

OPERATIONAL = "OPERATIONAL"
_RESETS = (129, 130)


class TwinNode:
    """A CANopen device on a network of its own."""

    def __init__(self, network: LoopNetwork, number: int, eds: Path) -> None:
        """Make the node with the objects of its data sheet; nothing is sent before `boot`."""
        self.network = network
        self.number = number
        self.local = canopen.LocalNode(number, str(eds))
        network.add_node(self.local)
        self._errors: dict[int, int] = {}
        network.subscribe(0, self._on_nmt)  # after canopen's own subscription, which sets the state

    @property
    def operational(self) -> bool:
        """True while PDOs are exchanged."""
        return self.local.nmt.state == OPERATIONAL

    def boot(self) -> None:
        """Start as after power-on: all objects as in the data sheet, boot-up message, pre-operational."""
        self.local.data_store.clear()
        self._errors.clear()
        # On these two changes of state canopen sends the boot-up message and starts the heartbeat.
        self.local.nmt.state = "INITIALISING"
        self.local.nmt.state = "PRE-OPERATIONAL"

    def stop(self) -> None:
        """Send no more heartbeats."""
        self.local.nmt.stop_heartbeat()

    def read(self, index: int, subindex: int = 0) -> int:
        """The value of one of the node's own objects."""
        return int.from_bytes(self.local.get_data(index, subindex), "little")

    def write(self, index: int, subindex: int, value: int) -> None:
        """Set one of the node's own objects."""
        size = len(self.local.get_data(index, subindex))
        self.local.set_data(index, subindex, value.to_bytes(size, "little"))

    def raise_error(self, code: int, register: int) -> None:
        """Send an emergency once, with its bits of the error register, and remember it in objects 1001 and 1003."""
        if code in self._errors:
            return
        self._errors[code] = register
        newest = [code, *(self.read(0x1003, place) for place in range(1, 4))]
        for place, entry in enumerate(newest, start=1):
            self.write(0x1003, place, entry)
        self.write(0x1003, 0, sum(1 for entry in newest if entry))
        self._write_register()
        self.local.emcy.send(code, self.read(0x1001))

    def clear_error(self, code: int) -> None:
        """The cause is gone; the error reset is sent when no other is left."""
        if self._errors.pop(code, None) is not None:
            self._write_register()
            if not self._errors:
                self.local.emcy.reset()

    def _write_register(self) -> None:
        register = 0
        for bits in self._errors.values():
            # CiA 301: bit 0, the generic error, is set with any other.
            register |= bits | 1
        self.write(0x1001, 0, register)

    def _on_nmt(self, _can_id: int, data: bytearray, _timestamp: float) -> None:
        command, number = data[0], data[1]
        if number not in (0, self.number):
            return
        if command in _RESETS:
            self.boot()
        self.on_state()

    def on_state(self) -> None:
        """Called when the state may have changed."""
        if self.operational:
            # The master has written the PDO objects before; canopen takes mapping and identifiers from them only here.
            self.local.rpdo.read()
            self.local.tpdo.read()

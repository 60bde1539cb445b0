"""Commands to a device that its TCP connection has not delivered."""

import asyncio
import socket
import struct

_ON_FOR_0_S = struct.pack("ii", 1, 0)


def discard_unsent(writer: asyncio.StreamWriter) -> None:
    """Have the connection's close discard what the device has not received.

    After an ordinary close the kernel still delivers it where a network comes back: a command that was given up would
    be carried out after the stop that followed it.
    """
    writer.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _ON_FOR_0_S)

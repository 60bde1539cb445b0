"""Emergency codes of CANopen (CiA 301, table of emergency error codes; CiA 401, emergency)."""

from station.messages import can as messages
from station.messages.message import Message

_NAMES = {
    0x2310: (messages.CURRENT_HIGH, messages.DO_FLAP),
    0x2320: (messages.SHORT_CIRCUIT, messages.DO_VALVE),
    0x2330: (messages.NO_LOAD, messages.DO_VALVE),
    0x3110: (messages.SUPPLY_HIGH, messages.DO_SUPPLY),
    0x3120: (messages.SUPPLY_LOW, messages.DO_SUPPLY),
    0x8110: (messages.FRAMES_LOST, messages.DO_LOAD),
    0x8120: (messages.ERROR_PASSIVE, messages.DO_CABLE),
    0x8130: (messages.HEARTBEAT_LOST, messages.DO_STATION),
    0x8140: (messages.RECOVERED, messages.DO_CABLE),
    0x8210: (messages.WRONG_LENGTH, messages.DO_AGAIN),
    0x8250: (messages.COUNT_LOST, messages.DO_ENCODER),
}
"""Code: what it says, and the remedy."""
_CLASSES = {
    0x1000: messages.GENERIC,
    0x2000: messages.CURRENT,
    0x3000: messages.VOLTAGE,
    0x4000: messages.TEMPERATURE,
    0x5000: messages.HARDWARE,
    0x6000: messages.SOFTWARE,
    0x7000: messages.MODULE,
    0x8000: messages.COMMUNICATION,
    0x9000: messages.EXTERNAL,
    0xF000: messages.ADDITIONAL,
}


def is_reset(code: int) -> bool:
    """Return whether a code reports that an error has gone, and all of them where the register is 0 (CiA 301: 00xx)."""
    return code & 0xFF00 == 0


def described_emergency(node: Message, code: int, register: int) -> Message:
    """Describe an emergency by its code and error register (object 0x1001), with the remedy."""
    what, remedy = _NAMES.get(code, (_CLASSES.get(code & 0xF000, messages.UNKNOWN), messages.DO_MANUAL))
    return messages.EMERGENCY(
        node=node, what=what(), code=f"0x{code:04X}", register=f"0x{register:02X}", remedy=remedy()
    )

"""Emergency codes of CANopen (CiA 301, table of emergency error codes; CiA 401, emergency)."""

_NAMES = {
    0x2310: ("the current at an output is too high", "look for what blocks the flap, and at its valve"),
    0x2320: ("an output has a short circuit", "look at the cable and the valve of the flap"),
    0x2330: ("an output carries no load", "look at the cable and the valve of the flap"),
    0x3110: ("its supply voltage is too high", "look at its power supply"),
    0x3120: ("its supply voltage is too low", "look at its power supply"),
    0x8110: ("it lost CAN frames", "look at the load and the bit rate of the bus"),
    0x8120: ("its CAN controller is error passive", "look at cable, termination and bit rate of the bus"),
    0x8130: ("it lost the station's heartbeat and put out its safe output", "look at why the station stopped"),
    0x8140: ("it recovered from bus-off", "look at cable, termination and bit rate of the bus"),
    0x8210: ("it got an order of the wrong length", "bring the bus up again; compare the node with its data sheet"),
    0x8250: ("it lost the encoder's count", "look at the encoder's power, cable and node id"),
}
"""Code: what it says, and the remedy."""
_CLASSES = {
    0x1000: "a generic error",
    0x2000: "a current is wrong",
    0x3000: "a voltage is wrong",
    0x4000: "a temperature is wrong",
    0x5000: "its hardware is faulty",
    0x6000: "its software is faulty",
    0x7000: "an additional module is faulty",
    0x8000: "its communication is disturbed",
    0x9000: "an external error",
    0xF000: "an additional function is faulty",
}


def is_reset(code: int) -> bool:
    """Return whether a code reports that no error is left (CiA 301: 00xx)."""
    return code & 0xFF00 == 0


def described_emergency(code: int, register: int) -> str:
    """Describe an emergency, with the remedy.

    Args:
        code: the emergency error code.
        register: the error register, object 0x1001.
    """
    what, remedy = _NAMES.get(
        code,
        (_CLASSES.get(code & 0xF000, "an error that CiA 301 does not know"), "look the code up in the node's manual"),
    )
    return f"{what} (emergency 0x{code:04X}, error register 0x{register:02X}); {remedy}"

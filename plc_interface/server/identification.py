"""Device identification, function code 43/14 (MODBUS Application Protocol Specification V1.1b3, section 6.21)."""

from importlib.metadata import version

from pymodbus.pdu.mei_message import ReadDeviceInformationResponse

from plc_interface.server.exceptions import illegal_address, illegal_function, illegal_value

READ_DEVICE_IDENTIFICATION = 14
_BASIC, _REGULAR, _EXTENDED, _SPECIFIC = 1, 2, 3, 4
_LAST_BASIC = 2
_REGULAR_AND_SPECIFIC = 0x82
"""Conformity: basic and regular objects, also one by one."""

OBJECTS = {
    0: b"fruit-station",
    1: b"plc_interface",
    2: version("fruit-station").encode(),
    4: b"Quality-inspection station for soft fruit",
}
"""Vendor name, product code, revision, and of the regular objects the product name."""


def identify(message: bytes) -> bytes:
    """Return the response to a request for the identification, from the function code on.

    Raises:
        RequestError: 01 for another interface than 14, 02 for an unknown object, 03 for a malformed one.
    """
    if len(message) < 2 or message[1] != READ_DEVICE_IDENTIFICATION:
        raise illegal_function("of function 43 only 14, the identification, is served")
    if len(message) != 4 or not _BASIC <= message[2] <= _SPECIFIC:
        raise illegal_value("an identification is asked for by a code from 1 to 4 and an object")
    code, first = message[2], message[3]
    if code == _SPECIFIC:
        if first not in OBJECTS:
            raise illegal_address(f"there is no object {first} in the identification")
        chosen = {first: OBJECTS[first]}
    else:
        last = _LAST_BASIC if code == _BASIC else max(OBJECTS)
        begin = first if first in OBJECTS and first <= last else 0
        chosen = {number: text for number, text in OBJECTS.items() if begin <= number <= last}
    response = ReadDeviceInformationResponse(read_code=code, information=dict(chosen))
    response.conformity = _REGULAR_AND_SPECIFIC
    return message[:1] + response.encode()

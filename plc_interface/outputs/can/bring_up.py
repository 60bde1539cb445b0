"""Configuration of a CANopen node over SDO before it is operational: identity, errors, objects, PDO mapping.

Every function waits for the node and is called from a worker thread. Objects: CiA 301, CiA 401 and CiA 406.
"""

import struct
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, NamedTuple

import can
import canopen
from canopen.objectdictionary import ObjectDictionary, ObjectDictionaryError
from canopen.pdo.base import PdoMap
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from plc_interface.outputs.can.errors import BringUpError
from station.messages import can as messages
from station.messages.message import Definition, Message
from station.settings.can import ENCODER_EDS, GATE_EDS, CanSettings

NODE_DEADLINE_S = 3.0
"""Longest wait for a node's first heartbeat or a change of its state. An estimate."""
POLL_S = 0.02
"""Period of the checks while waiting. An estimate."""
_BEHAVIOUR = 0xFFFF_0000
"""The upper half of a revision; the lower one never changes what a node does (CiA 301, object 1018)."""
_ERROR_PART = 0xFFFF


class Node(NamedTuple):
    """One of the two nodes, as canopen represents it."""

    remote: canopen.RemoteNode
    number: int
    name: Message
    """With the node id."""
    setting: str
    """The setting that holds its node id."""


class Pdo(NamedTuple):
    """Required configuration of a PDO; its content is defined in the data sheet."""

    map: PdoMap
    cob_id: int
    event_timer_ms: int


class DataSheets(NamedTuple):
    """The objects of both nodes, by their data sheets and node ids."""

    gate: ObjectDictionary
    encoder: ObjectDictionary


def read_data_sheets(settings: CanSettings) -> DataSheets:
    """Parse both data sheets; call it before the event loop serves requests, which would wait for it."""
    return DataSheets(
        canopen.import_od(str(GATE_EDS), settings.gate_node), canopen.import_od(str(ENCODER_EDS), settings.encoder_node)
    )


def make_gate(network: canopen.Network, settings: CanSettings, sheets: DataSheets) -> Node:
    """Make the reject gate's node on this network; replaces an earlier one."""
    return _make(network, settings, "gate_node", messages.GATE, sheets.gate)


def make_encoder(network: canopen.Network, settings: CanSettings, sheets: DataSheets) -> Node:
    """Make the line encoder's node on this network; replaces an earlier one."""
    return _make(network, settings, "encoder_node", messages.ENCODER, sheets.encoder)


def _make(
    network: canopen.Network, settings: CanSettings, setting: str, name: Definition, objects: ObjectDictionary
) -> Node:
    number = getattr(settings, setting)
    remote = network.add_node(number, objects)
    remote.sdo.RESPONSE_TIMEOUT = settings.answer_timeout_s
    return Node(remote, number, name(node=number), f"can.{setting}")


def no_heartbeat(node: Node, settings: CanSettings) -> Message:
    """Describe a node without heartbeat."""
    return messages.NO_HEARTBEAT(
        node=node.name, interface=settings.interface, channel=settings.channel, setting=node.setting
    )


def verify_identity(node: Node) -> str:
    """Compare a node's identity with the data sheet, and return product and revision as text.

    Raises:
        BringUpError: it is another device, or does not answer.
    """
    for index, subindex, mask, what in (
        (0x1000, 0, 0xFFFF_FFFF, messages.DEVICE_TYPE),
        (0x1018, 1, 0xFFFF_FFFF, messages.VENDOR),
        (0x1018, 2, 0xFFFF_FFFF, messages.PRODUCT),
        (0x1018, 3, _BEHAVIOUR, messages.REVISION),
    ):
        found, wanted = _get(node, index, subindex), _default(node, index, subindex)
        if found & mask != wanted & mask:
            raise BringUpError(
                messages.ANOTHER_DEVICE(
                    node=node.name,
                    what=what(),
                    found=f"0x{found:08X}",
                    expected=f"0x{wanted:08X}",
                    setting=node.setting,
                )
            )
    revision = _get(node, 0x1018, 3)
    return f"{node.remote.object_dictionary.device_information.product_name} {revision >> 16}.{revision & 0xFFFF}"


def active_error(node: Node) -> tuple[int, int] | None:
    """Return the node's latest active error as code and error register; None if it has none.

    Raises:
        BringUpError: it does not answer.
    """
    register = _get(node, 0x1001, 0)
    if not register:
        return None
    return (_get(node, 0x1003, 1) & _ERROR_PART if _get(node, 0x1003, 0) else 0x1000), register


def configure_gate(node: Node, settings: CanSettings) -> None:
    """Write the gate's safe behaviour, its heartbeat consumer and its PDOs; each value is read back.

    Raises:
        BringUpError: it refuses, stores another value, or does not answer.
    """
    _put(node, 0x1017, 0, _ms(settings.heartbeat_s))
    _put(node, 0x6206, 1, 0xFF)
    _put(node, 0x6207, 1, settings.safe_output)
    _put(node, 0x1029, 1, 0)
    _write_pdos(node, gate_pdos(node, settings))
    _put(node, 0x1016, 1, settings.station_node << 16 | _ms(settings.heartbeat_lost_s))


def configure_encoder(node: Node, settings: CanSettings) -> None:
    """Write the encoder's transmission period and its PDO; each value is read back.

    Raises:
        BringUpError: it refuses, stores another value, does not count through 32 bits, or does not answer.
    """
    _put(node, 0x1017, 0, _ms(settings.heartbeat_s))
    _put(node, 0x6002, 0, 0xFFFF_FFFF)
    _write_pdos(node, encoder_pdos(node, settings))


def gate_pdos(node: Node, settings: CanSettings) -> dict[str, Pdo]:
    """Return the gate's PDOs: it receives orders and the encoder's count, and sends reports."""
    remote = node.remote
    return {
        "RPDO 1": Pdo(remote.rpdo[1], 0x200 + node.number, 0),
        "RPDO 2": Pdo(remote.rpdo[2], 0x180 + settings.encoder_node, _ms(settings.count_stale_s)),
        "TPDO 1": Pdo(remote.tpdo[1], 0x180 + node.number, 0),
    }


def encoder_pdos(node: Node, settings: CanSettings) -> dict[str, Pdo]:
    """Return the encoder's PDO: its count."""
    return {"TPDO 1": Pdo(node.remote.tpdo[1], 0x180 + node.number, _ms(settings.encoder_period_s))}


class ForeignMapping(NamedTuple):
    """A PDO whose mapping differs from the required one."""

    pdo: str
    found: str
    expected: str


def foreign_mapping(node: Node, pdos: dict[str, Pdo]) -> ForeignMapping | None:
    """Return the first PDO whose mapping differs from the required one; None if all agree.

    Raises:
        BringUpError: it does not answer.
    """
    for name, pdo in pdos.items():
        wanted = _wanted(pdo)
        with _sdo_access(node, messages.READING_MAPPING(pdo=name)):
            pdo.map.read()
        if _layout(pdo.map) != wanted:
            return ForeignMapping(name, _layout(pdo.map), wanted)
    return None


def _write_pdos(node: Node, pdos: dict[str, Pdo]) -> None:
    for name, pdo in pdos.items():
        _wanted(pdo)
        with _sdo_access(node, messages.WRITING_MAPPING(pdo=name)):
            pdo.map.save()
    if (foreign := foreign_mapping(node, pdos)) is not None:
        raise BringUpError(messages.ANOTHER_MAPPING(node=node.name, **foreign._asdict()))


def _wanted(pdo: Pdo) -> str:
    """Prepare a PDO map for writing, and describe it."""
    pdo.map.read(from_od=True)
    pdo.map.cob_id, pdo.map.event_timer, pdo.map.enabled = pdo.cob_id, pdo.event_timer_ms, True
    return _layout(pdo.map)


def _layout(pdo: PdoMap) -> str:
    carried = " ".join(f"{var.index:04X}:{var.subindex:02X}/{var.length}" for var in pdo.map)
    on = "" if pdo.enabled else " off"
    return f"[{carried}] at 0x{pdo.cob_id or 0:03X}{on}, type {pdo.trans_type}, timer {pdo.event_timer} ms"


@contextmanager
def _sdo_access(node: Node, access: Message) -> Iterator[None]:
    try:
        yield
    except SdoAbortedError as error:
        raise BringUpError(messages.REFUSED(node=node.name, access=access, error=str(error))) from error
    except SdoCommunicationError as error:
        raise BringUpError(messages.NO_ANSWER(node=node.name, access=access)) from error
    except (struct.error, ObjectDictionaryError) as error:
        raise BringUpError(messages.NONSENSE(node=node.name, access=access, error=str(error))) from error
    except (can.CanError, OSError, RuntimeError) as error:
        raise BringUpError(messages.FAILED_MEANWHILE(node=node.name, access=access, error=str(error))) from error


def _variable(node: Node, index: int, subindex: int) -> Any:
    entry: Any = node.remote.sdo[index]
    return entry[subindex] if isinstance(entry, Mapping) else entry


def _default(node: Node, index: int, subindex: int) -> int:
    return _variable(node, index, subindex).od.default


def _get(node: Node, index: int, subindex: int) -> int:
    variable = _variable(node, index, subindex)
    with _sdo_access(node, messages.READING(object=variable.name)):
        return variable.raw


def _put(node: Node, index: int, subindex: int, value: int) -> None:
    variable = _variable(node, index, subindex)
    with _sdo_access(node, messages.WRITING(object=variable.name, value=f"0x{value:X}")):
        variable.raw = value
    stored = _get(node, index, subindex)
    if stored != value:
        raise BringUpError(
            messages.ANOTHER_VALUE(node=node.name, object=variable.name, written=f"0x{value:X}", read=f"0x{stored:X}")
        )


def read_position(node: Node) -> int:
    """Read the encoder's count.

    Raises:
        BringUpError: it does not answer.
    """
    return _get(node, 0x6004, 0)


def _ms(duration_s: float) -> int:
    return round(1000 * duration_s)

"""CAN settings: the bus, its two nodes, and their time-outs."""

import ipaddress
import re
from pathlib import Path
from typing import Literal, Self

from pydantic import model_validator

from station.messages import settings as messages
from station.settings.model import Settings, setting
from station.settings.problems import FieldError

EDS_FOLDER = Path(__file__).parent / "eds"
"""The nodes' electronic data sheets, common to the station and to the builder of a node."""
GATE_EDS = EDS_FOLDER / "reject_gate.eds"
ENCODER_EDS = EDS_FOLDER / "line_encoder.eds"

_INTERFACE_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_.-]{0,14}")
_FEWEST_BEATS = 2


class CanSettings(Settings):
    """The reject gate and the line encoder on CANopen."""

    enabled: bool = setting(
        False,  # noqa: FBT003 (the default of a field)
        title="Enabled",
        description="Whether the station diverts fruit itself by CAN; off, the line's PLC does.",
    )
    interface: Literal["virtual", "udp_multicast", "socketcan"] = setting(
        "udp_multicast",
        title="Interface",
        description="`socketcan` for a real bus, `udp_multicast` between processes of this machine (the twin), "
        "`virtual` within one process (tests).",
    )
    channel: str = setting(
        "239.74.163.2",
        title="Channel",
        description="Name of the network interface for `socketcan` (can0), multicast address for `udp_multicast`, any "
        "name for `virtual`.",
        min_length=1,
        max_length=64,
    )
    port: int = setting(
        43113, title="Port", description="UDP port of `udp_multicast`; unused otherwise.", ge=1024, le=65_535
    )
    bitrate: int = setting(
        250_000,
        title="Bit rate",
        description="Of a real bus. The system sets it, not the station: see docs/plc/can.md for the command.",
        unit="bit/s",
        ge=10_000,
        le=1_000_000,
    )
    station_node: int = setting(
        1, title="Station's node", description="Node id under which the station sends its heartbeat.", ge=1, le=127
    )
    gate_node: int = setting(16, title="Gate's node", description="Node id of the reject gate.", ge=1, le=127)
    encoder_node: int = setting(17, title="Encoder's node", description="Node id of the line encoder.", ge=1, le=127)
    heartbeat_s: float = setting(
        0.1,
        title="Heartbeat",
        description="Period of the heartbeats of the station and of each node.",
        unit="s",
        ge=0.01,
        le=5.0,
    )
    heartbeat_lost_s: float = setting(
        0.5,
        title="Heartbeat lost after",
        description="After so long a silence a node is lost; a node that has lost the station sets its safe output by "
        "itself.",
        unit="s",
        ge=0.05,
        le=30.0,
    )
    answer_timeout_s: float = setting(
        0.5,
        title="Answer time-out",
        description="Longest wait for the answer to one SDO; a healthy node needs a few milliseconds.",
        unit="s",
        ge=0.02,
        le=10.0,
    )
    retry_s: float = setting(
        0.5,
        title="Retry after",
        description="Pause before the bus is brought up again; it doubles with each failure, up to 10 s.",
        unit="s",
        ge=0.05,
        le=10.0,
    )
    encoder_period_s: float = setting(
        0.01,
        title="Encoder's period",
        description="How often the encoder sends its count; at 0.01 s and 300 mm/s the belt moves 3 mm in between.",
        unit="s",
        ge=0.001,
        le=1.0,
    )
    count_stale_s: float = setting(
        0.2,
        title="Count stale after",
        description="An older encoder count is unknown: no actuation is ordered on it, and the gate does not fire.",
        unit="s",
        ge=0.005,
        le=5.0,
    )
    distance_counts: int = setting(
        90_000,
        title="Nest to gate",
        description="Encoder counts from the nest to the gate's flap; measure yours. The default gives the twin 30 s.",
        ge=1,
        le=1_000_000_000,
    )
    tolerance_counts: int = setting(
        100,
        title="Tolerance of a reject",
        description="Largest distance of the reported from the ordered count; it has to cover the belt's way in "
        "one period of the encoder, 30 counts on the twin.",
        ge=0,
        le=1_000_000,
    )
    pulse_ms: int = setting(
        120, title="Pulse", description="How long the flap stays open for one fruit.", unit="ms", ge=5, le=255
    )
    echo_deadline_s: float = setting(
        0.25,
        title="Echo deadline",
        description="How long the gate may take to confirm an order, and to report its actuation at the count.",
        unit="s",
        ge=0.01,
        le=10.0,
    )
    shot_deadline_s: float = setting(
        60.0,
        title="Shot deadline",
        description="Maximum wait of an ordered reject actuation for its count, for example if the belt stops.",
        unit="s",
        ge=0.5,
        le=3600.0,
    )
    safe_output: int = setting(
        1,
        title="Safe output",
        description="Output of the gate while the station is lost or not healthy: bit n opens the flap of lane "
        "n + 1. 1 sends everything to lane 1, the rejects'.",
        ge=0,
        le=255,
    )

    @property
    def real_bus(self) -> bool:
        """True if the nodes may be real ones; on every other bus they are the twin's."""
        return self.interface == "socketcan" and not self.channel.startswith("vcan")

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        if len({self.station_node, self.gate_node, self.encoder_node}) < 3:
            raise FieldError([((), messages.NODES_NOT_DISTINCT())])
        least_s = _FEWEST_BEATS * self.heartbeat_s
        if self.heartbeat_lost_s < least_s:
            expected = messages.HEARTBEAT_TOO_STRICT(limit_s=self.heartbeat_lost_s, least_s=least_s)
            raise FieldError([(("heartbeat_lost_s",), expected)])
        least_s = _FEWEST_BEATS * self.encoder_period_s
        if self.count_stale_s < least_s:
            expected = messages.COUNT_TOO_STRICT(limit_s=self.count_stale_s, least_s=least_s)
            raise FieldError([(("count_stale_s",), expected)])
        if self.interface == "udp_multicast" and not _is_multicast(self.channel):
            raise FieldError([(("channel",), messages.NO_MULTICAST(channel=self.channel))])
        if self.interface == "socketcan" and not _INTERFACE_NAME.fullmatch(self.channel):
            raise FieldError([(("channel",), messages.NO_INTERFACE(channel=self.channel))])
        return self


def _is_multicast(channel: str) -> bool:
    try:
        return ipaddress.ip_address(channel).is_multicast
    except ValueError:
        return False

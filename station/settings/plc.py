"""PLC interface settings: time-outs for the PLC and for the station."""

from pathlib import Path
from typing import Self

from pydantic import model_validator

from station.errors import BadInputError
from station.messages import settings as messages
from station.settings.model import Settings, setting
from station.settings.problems import FieldError

ENDPOINT_PATTERN = r"^(ipc://.+|tcp://127\..+:[0-9]+)$"
LONGEST_SOCKET_PATH = 107
"""Linux, unix(7): a socket's path with its closing NUL fits 108 bytes."""


class HandshakeSettings(Settings):
    """Deadlines and time-outs of the handshake, and the endpoint of the station."""

    endpoint: str | None = setting(
        None,
        title="Station's endpoint",
        description="Where the station answers the PLC interface: ipc://PATH or tcp://127.0.0.1:PORT; null for "
        "run/line.ipc in the home folder.",
        pattern=ENDPOINT_PATTERN,
        max_length=200,
    )
    beat_period_s: float = setting(
        0.1,
        title="Beat period",
        description="Period of the queries of the station's state; its heartbeat to the PLC changes with "
        "the same period.",
        unit="s",
        ge=0.02,
        le=5.0,
    )
    station_lost_after_s: float = setting(
        1.0,
        title="Station lost after",
        description="So long without an answered beat, and the station counts as lost: what was running ends as "
        "NO_RESULT.",
        unit="s",
        ge=0.1,
        le=30.0,
    )
    begin_deadline_s: float = setting(
        0.5,
        title="Trigger's answer within",
        description="A trigger that the station has neither accepted nor refused by then is refused. The PLC waits "
        "so long for trigger_acknowledged at most.",
        unit="s",
        ge=0.05,
        le=10.0,
    )
    result_margin_s: float = setting(
        0.3,
        title="Result's margin",
        description="So long after the station's own deadline, the interface answers NO_RESULT for it.",
        unit="s",
        ge=0.0,
        le=10.0,
    )
    command_deadline_s: float = setting(
        30.0,
        title="Command's deadline",
        description="A command that the station has not ended by then is reported as timed out.",
        unit="s",
        ge=0.1,
        le=300.0,
    )
    plc_heartbeat_timeout_s: float = setting(
        1.0,
        title="PLC lost after",
        description="A PLC whose heartbeat has changed once and then stops for so long is lost: disarmed, results "
        "retained. A client that never changes it is not monitored.",
        unit="s",
        ge=0.05,
        le=60.0,
    )
    handshake_timeout_s: float = setting(
        5.0,
        title="Time-out for the reset of a bit",
        description="A bit that the PLC has not taken back so long after its answer counts as taken back, as a fault.",
        unit="s",
        ge=0.05,
        le=60.0,
    )

    @model_validator(mode="after")
    def _beats_fit(self) -> Self:
        if self.station_lost_after_s < 3 * self.beat_period_s:
            expected = messages.TOO_FEW_BEATS(limit_s=self.station_lost_after_s, period_s=self.beat_period_s)
            raise FieldError([((), expected)])
        return self


def line_endpoint(settings: HandshakeSettings, home: Path) -> str:
    """Return the endpoint of the line's channel; see `channel_endpoint`."""
    return channel_endpoint(settings.endpoint, home, "line", "handshake.endpoint")


def channel_endpoint(endpoint: str | None, home: Path, name: str, field: str) -> str:
    """Return the endpoint of a channel.

    Args:
        endpoint: as configured; None for a socket of the channel's name in the home folder.
        home: absolute.
        field: the setting that names it.

    Raises:
        BadInputError: the path is too long for a socket.
    """
    endpoint = endpoint or f"ipc://{home / 'run' / name}.ipc"
    path = endpoint.removeprefix("ipc://")
    if path != endpoint and len(path.encode()) > LONGEST_SOCKET_PATH:
        raise BadInputError(
            f"the {name}'s socket {path} has more than {LONGEST_SOCKET_PATH} bytes, which no UNIX socket's path may: "
            f"choose a shorter home folder, or set {field} to a short ipc:// path"
        )
    return endpoint

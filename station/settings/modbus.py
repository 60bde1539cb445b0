"""Modbus settings: addresses, permitted clients, time-outs of connections."""

from typing import Literal, Self

from pydantic import model_validator

from station.messages import settings as messages
from station.settings.model import Settings, setting
from station.settings.network import Host, Network, Port
from station.settings.paths import File
from station.settings.problems import FieldError

LOOPBACK = ("127.0.0.0/8", "::1/128")


class ModbusTlsSettings(Settings):
    """Modbus/TCP Security: a second port with TLS 1.3, where a client's certificate defines its rights."""

    enabled: bool = setting(
        default=False,
        title="Served",
        description="Whether the second port is served; it needs the three files below.",
    )
    port: Port = setting(
        5802,
        title="Port",
        description="TCP port of Modbus over TLS; the registered one is 802, which needs the right to bind low ports.",
    )
    certificate: File | None = setting(
        None, title="Certificate", description="PEM file with the station's certificate and its chain."
    )
    key: File | None = setting(
        None, title="Private key", description="PEM file with the certificate's private key, without a passphrase."
    )
    client_authority: File | None = setting(
        None,
        title="Clients' authority",
        description="PEM file with the certificates of the authority that signs the clients' certificates.",
    )

    @model_validator(mode="after")
    def _has_its_files(self) -> Self:
        missing = [name for name in ("certificate", "key", "client_authority") if getattr(self, name) is None]
        if self.enabled and missing:
            raise FieldError([((), messages.TLS_WITHOUT_FILES(files=", ".join(missing)))])
        return self


class ModbusSettings(Settings):
    """Addresses of the Modbus TCP server, and its permitted clients."""

    host: Host = setting(
        "127.0.0.1",
        title="Address",
        description="Network address on which Modbus TCP is served; loopback until a site decides otherwise.",
        max_length=253,
    )
    port: Port = setting(
        5020,
        title="Port",
        description="TCP port of Modbus; a site sets 502, which needs the right to bind low ports.",
    )
    unit: int = setting(
        1,
        title="Unit",
        description="Modbus unit identifier that the station answers to; 0 and 255 mean the server itself and are "
        "answered too.",
        ge=1,
        le=247,
    )
    word_order: Literal["high_first", "low_first"] = setting(
        "high_first",
        title="Word order",
        description="Which register of a 32- or 64-bit value comes first; the bytes in a register are big-endian.",
    )
    readers: tuple[Network, ...] = setting(
        LOOPBACK,
        title="Who may read",
        description="Addresses and networks whose connections are accepted; all others are closed. Loopback until set.",
        max_length=64,
    )
    writers: tuple[Network, ...] = setting(
        LOOPBACK,
        title="Who may write",
        description="Addresses and networks that may write, if they may read too; the line's PLC. Loopback until set.",
        max_length=64,
    )
    max_connections: int = setting(
        32,
        title="Connections",
        description="Connections at one time; four more are reserved for the writer to reconnect.",
        ge=1,
        le=512,
    )
    max_per_address: int = setting(
        8,
        title="Connections of one address",
        description="Connections at one time of one address, so that no reader takes all places; four more for the "
        "writer to reconnect.",
        ge=1,
        le=512,
    )
    idle_timeout_s: float = setting(
        60.0,
        title="Idle time-out",
        description="A connection without a request for this time is closed.",
        unit="s",
        ge=1.0,
        le=86_400.0,
    )
    frame_timeout_s: float = setting(
        5.0,
        title="Frame time-out",
        description="A connection is closed when a request is not complete, or replies are not read, for this time.",
        unit="s",
        ge=0.1,
        le=60.0,
    )
    writer_lease_s: float = setting(
        10.0,
        title="Writer's lease",
        description="After this time without a write from the writer another client may write.",
        unit="s",
        ge=0.5,
        le=3600.0,
    )
    tls: ModbusTlsSettings = setting(
        ModbusTlsSettings(), title="Modbus over TLS", description="A second port with client certificates and roles."
    )

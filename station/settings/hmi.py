"""HMI settings: addresses, TLS, languages, idle times."""

from pathlib import Path
from typing import Literal, Self, get_args

from pydantic import model_validator

from station.messages import settings as messages
from station.settings.model import Settings, setting
from station.settings.network import Host, Port
from station.settings.paths import File
from station.settings.plc import ENDPOINT_PATTERN, channel_endpoint
from station.settings.problems import FieldError

Language = Literal["en", "de", "es"]
"""All languages of the pages; `./run messages` makes the catalogues of a new one."""
LANGUAGES: tuple[Language, ...] = get_args(Language)


class HmiTlsSettings(Settings):
    """The operators' pages over TLS."""

    enabled: bool = setting(
        default=False, title="Served", description="Whether the pages are served over TLS; it needs both files below."
    )
    certificate: File | None = setting(
        None, title="Certificate", description="PEM file with the station's certificate and its chain."
    )
    key: File | None = setting(
        None, title="Private key", description="PEM file with the certificate's private key, without a passphrase."
    )

    @model_validator(mode="after")
    def _has_its_files(self) -> Self:
        missing = [name for name in ("certificate", "key") if getattr(self, name) is None]
        if self.enabled and missing:
            raise FieldError([((), messages.TLS_WITHOUT_FILES(files=", ".join(missing)))])
        return self


class HmiSettings(Settings):
    """Address of the operators' pages, languages, and time until a log-out."""

    host: Host = setting(
        "127.0.0.1",
        title="Address",
        description="Network address on which the operators' pages are served.",
        max_length=253,
    )
    port: Port = setting(8080, title="Port", description="TCP port of the operators' pages over HTTP.")
    names: tuple[Host, ...] = setting(
        ("127.0.0.1", "localhost"),
        title="Names",
        description="Names under which browsers may request the pages, besides the address above; a request for "
        "another name is refused, because a foreign page may have sent it.",
        max_length=16,
    )
    tls: HmiTlsSettings = setting(
        HmiTlsSettings(), title="HMI over TLS", description="Outside the machine the pages are to be served over TLS."
    )
    languages: tuple[Language, ...] = setting(
        LANGUAGES,
        title="Languages",
        description="Languages to choose from; the first is used if the browser requests none of them.",
        min_length=1,
        max_length=len(LANGUAGES),
    )
    idle_s: float = setting(
        180.0,
        title="Idle time",
        description="A person who touches nothing for so long is logged out; the page continues as a viewer's.",
        unit="s",
        ge=10.0,
        le=3600.0,
    )
    refresh_s: float = setting(
        0.2,
        title="Refresh",
        description="Period of sending new data to the pages.",
        unit="s",
        ge=0.05,
        le=1.0,
    )
    pages_per_address: int = setting(
        16,
        title="Pages per address",
        description="Open pages with live data at one address, or of one person who is logged in; an address has three "
        "connections for each. More where many browsers share an address, as behind a proxy.",
        ge=4,
        le=60,
    )
    cleaning_s: float = setting(
        30.0,
        title="Cleaning time",
        description="Duration of the cleaning lock, during which a screen ignores touches.",
        unit="s",
        ge=5.0,
        le=300.0,
    )
    endpoint: str | None = setting(
        None,
        title="Station's endpoint",
        description="Where the station answers the pages: ipc://PATH or tcp://127.0.0.1:PORT; null for run/panel.ipc "
        "in the home folder.",
        pattern=ENDPOINT_PATTERN,
        max_length=200,
    )


def panel_endpoint(settings: HmiSettings, home: Path) -> str:
    """Return the endpoint of the panel's channel; see `channel_endpoint`."""
    return channel_endpoint(settings.endpoint, home, "panel", "hmi.endpoint")


def address_of(settings: HmiSettings) -> str:
    """Return the address for a browser."""
    host = f"[{settings.host}]" if ":" in settings.host else settings.host
    return f"{'https' if settings.tls.enabled else 'http'}://{host}:{settings.port}"

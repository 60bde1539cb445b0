"""Types of network addresses in settings; texts, as strict JSON takes no address object for a default."""

import ipaddress
import re
from typing import Annotated

from pydantic import AfterValidator, Field

from station.messages import settings as messages
from station.settings.problems import WantedError

_HOST_NAME = re.compile(r"(?=.{1,253}$)(?!-)[A-Za-z0-9-]{1,63}(?<!-)(\.(?!-)[A-Za-z0-9-]{1,63}(?<!-))*")


def _host(text: str) -> str:
    """Refuse what is neither an IP address nor a host's name; digits and dots alone are an address or nothing."""
    try:
        ipaddress.ip_address(text)
    except ValueError:
        if not _HOST_NAME.fullmatch(text) or re.fullmatch(r"[0-9.]+", text):
            raise WantedError(messages.HOST()) from None
    return text


def _network(text: str) -> str:
    """Refuse an invalid network, and one with bits behind its prefix, which may be a typing error."""
    try:
        ipaddress.ip_network(text)
    except ValueError:
        raise WantedError(messages.NETWORK()) from None
    return text


Host = Annotated[str, AfterValidator(_host)]
"""An IP address or a host's name."""
Network = Annotated[str, AfterValidator(_network)]
"""One IP address, or a network in CIDR notation."""
Port = Annotated[int, Field(ge=1, le=65_535)]
"""Of TCP."""

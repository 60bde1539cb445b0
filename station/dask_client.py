"""Client of a Dask scheduler, whose workers measure or judge in place of this machine's processes."""

import importlib
import socket
from typing import Any
from urllib.parse import urlsplit

from station.errors import BadInputError
from station.messages import cluster as messages

_TIMEOUT_S = 10.0


def connect(address: str) -> Any:
    """Connect to a scheduler, and return a `distributed.Client`, which the caller closes.

    Args:
        address: as `tcp://10.0.0.5:8786`; TCP if it names no protocol, as Dask has it.

    Raises:
        BadInputError: Dask is not installed here, or the address is invalid or does not answer.
    """
    try:
        distributed = importlib.import_module("distributed")  # an optional extra, and slow to import
    except ImportError as error:
        raise BadInputError(messages.NO_EXTRA()) from error
    address = address if "://" in address else f"tcp://{address}"
    _reach(address)
    try:
        return distributed.Client(address, timeout=_TIMEOUT_S)
    except (OSError, ValueError, TypeError) as error:  # TypeError: tls without its certificate
        raise BadInputError(messages.NO_SCHEDULER(address=address, words=str(error))) from error


def _reach(address: str) -> None:
    """Connect a socket first: Dask's own client retries a closed port until its timeout, and leaves threads behind."""
    try:
        parts = urlsplit(address)
        if parts.scheme not in {"tcp", "tls"} or parts.hostname is None or parts.port is None:
            raise BadInputError(messages.BAD_ADDRESS(address=address))
        socket.create_connection((parts.hostname, parts.port), _TIMEOUT_S).close()
    except (OSError, ValueError) as error:
        raise BadInputError(messages.NO_SCHEDULER(address=address, words=str(error))) from error

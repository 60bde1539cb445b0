"""Address filter: addresses that may read, and those that may write."""

import ipaddress
from collections.abc import Iterable


class AllowList:
    """Networks; an address is allowed if it is in one of them."""

    def __init__(self, networks: Iterable[str]) -> None:
        """Take networks in CIDR notation or single addresses; ValueError for anything else."""
        self._networks = tuple(ipaddress.ip_network(network) for network in networks)

    def allows(self, address: str) -> bool:
        """Return whether an address, as `plain_address` returns it, is in one of the networks."""
        parsed = ipaddress.ip_address(address)
        return any(parsed in network for network in self._networks)


def plain_address(address: str) -> str:
    """Return a socket's peer address without its zone, and as IPv4 if it is IPv4 mapped into IPv6."""
    parsed = ipaddress.ip_address(address.partition("%")[0])
    mapped = parsed.ipv4_mapped if isinstance(parsed, ipaddress.IPv6Address) else None
    return str(mapped or parsed)

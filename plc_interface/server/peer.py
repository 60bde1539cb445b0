"""Peer of a connection."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, eq=False)
class Peer:
    """One connection's other end; another connection of the same client is another peer."""

    address: str
    """IP address; an IPv4 address mapped into IPv6 as IPv4."""
    port: int
    may_write: bool
    name: str = ""
    """Subject of its certificate; empty without TLS."""

    def __str__(self) -> str:
        place = f"[{self.address}]:{self.port}" if ":" in self.address else f"{self.address}:{self.port}"
        return f"{place} ({self.name})" if self.name else place

"""Firewall rules of a site's configuration: nftables that close everything but the conduits, in both directions."""

import ipaddress
from collections.abc import Iterable, Mapping

from station.settings.conduits import Conduit, Zone, conduits
from station.settings.configuration import Configuration
from station.settings.modbus import LOOPBACK


def rules(site: Configuration, zones: Mapping[Zone, tuple[str, ...]], maintenance: tuple[str, ...] = ()) -> str:
    """Return the rules as a file for `nft -f`.

    A conduit that listens on loopback, or calls there, needs no rule. Names of hosts are left to the address lists of
    their zone, as rules take none.

    Args:
        site: with the ports and the peers.
        zones: the addresses and networks of each zone; a missing zone is blocked.
        maintenance: sources of SSH, and the servers of time and names.

    Raises:
        ValueError: an address is invalid.
    """
    opened = [each for each in conduits(site) if each.enabled and not _loopback(each.host)]
    inward = [line for each in opened if each.target is Zone.STATION for line in _inward(each, zones)]
    outward = [line for each in opened if each.source is Zone.STATION for line in _outward(each, zones)]
    inward += [f"{_from(group)} tcp dport 22 accept  # maintenance" for group in _families(maintenance)]
    outward += [
        f"{_to(group)} {protocol} dport {port} accept  # {what}"
        for group in _families(maintenance)
        for protocol, port, what in (("udp", 123, "time"), ("udp", 53, "names"))
    ]
    return _FILE.format(inward=_indented(inward), outward=_indented(outward))


_FILE = """\
#!/usr/sbin/nft -f
# Made by: station config firewall. What is not opened here is closed; a person's SSH, too, unless it is named.

table inet fruit_station
delete table inet fruit_station

table inet fruit_station {{
    chain inward {{
        type filter hook input priority filter; policy drop;
        iifname "lo" accept
        ct state established,related accept
        ct state invalid drop
        icmp type echo-request limit rate 10/second accept
        icmpv6 type {{ nd-neighbor-solicit, nd-neighbor-advert, nd-router-advert, echo-request }} accept
{inward}        limit rate 5/minute log prefix "fruit-station refused: "
    }}
    chain through {{
        type filter hook forward priority filter; policy drop;
    }}
    chain outward {{
        type filter hook output priority filter; policy drop;
        oifname "lo" accept
        ct state established,related accept
        icmpv6 type {{ nd-neighbor-solicit, nd-neighbor-advert, nd-router-solicit, echo-request }} accept
        icmp type echo-request accept
{outward}        limit rate 5/minute log prefix "fruit-station kept in: "
        reject
    }}
}}
"""


def _inward(conduit: Conduit, zones: Mapping[Zone, tuple[str, ...]]) -> Iterable[str]:
    """Return the peers in the setting, or else the zone."""
    named = tuple(peer for peer in conduit.peers if peer not in LOOPBACK)
    for group in _families(named or zones.get(conduit.source, ())):
        yield f"{_from(group)} tcp dport {conduit.port} accept  # {conduit.protocol}: {conduit.setting}"


def _outward(conduit: Conduit, zones: Mapping[Zone, tuple[str, ...]]) -> Iterable[str]:
    """Return the one host if it is an address, else its zone."""
    hosts = (conduit.host,) if _address(conduit.host) else zones.get(conduit.target, ())
    for group in _families(hosts):
        yield f"{_to(group)} tcp dport {conduit.port} accept  # {conduit.protocol}: {conduit.setting}"


def _families(networks: Iterable[str]) -> list[tuple[str, tuple[str, ...]]]:
    """Return networks by their family, with nftables' name of it."""
    parsed = [ipaddress.ip_network(network) for network in networks]
    return [
        (name, found)
        for name, version in (("ip", 4), ("ip6", 6))
        if (found := tuple(str(each) for each in parsed if each.version == version))
    ]


def _from(group: tuple[str, tuple[str, ...]]) -> str:
    return f"{group[0]} saddr {{ {', '.join(group[1])} }}"


def _to(group: tuple[str, tuple[str, ...]]) -> str:
    return f"{group[0]} daddr {{ {', '.join(group[1])} }}"


def _indented(lines: Iterable[str]) -> str:
    return "".join(f"        {line}\n" for line in lines)


def _address(host: str) -> bool:
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True


def _loopback(host: str) -> bool:
    return host == "localhost" or host.startswith(("127.", "/")) or host == "::1"

"""Settings that earlier versions of `station.yaml` had."""

from typing import NamedTuple


class Move(NamedTuple):
    """A setting with a new place. An old place is never reused."""

    old: tuple[str, ...]
    new: tuple[str, ...]


MOVES = (Move(("service", "channel"), ("handshake", "endpoint")),)
WITHOUT_EFFECT = (("arm", "restart_budget"), ("arm", "restart_window_s"), ("camera", "replay", "widths"))
"""Settings that are gone: nothing takes their place."""
EARLIER = frozenset((*(move.old for move in MOVES), *WITHOUT_EFFECT))
"""The places of all of them."""

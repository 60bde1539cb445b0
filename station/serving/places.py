"""Places shared by holders: none of them can take all, and known holders have a reserve that strangers cannot take."""

import time
from collections import Counter
from collections.abc import Callable, Iterator
from typing import Generic, Protocol, TypeVar

from station.allowance import Allowance

FLOOD_BURST, FLOOD_REFILL_S = 30, 1.0
"""Newcomers at a full house that are no flood yet: at once, and time for one more."""
FLOOD_S = 60.0
"""A flood is over after this time without another one."""


class Member(Protocol):
    """Member: holder of one place."""

    holder: str
    """The address, or the person, that the place counts for."""
    known: bool
    """Whether the holder's places are those of the reserve."""

    @property
    def rank(self) -> tuple[float, ...] | None:
        """The lowest gives way to a newcomer first; None for one that does not."""

    def displace(self) -> None:
        """End, because a newcomer has taken the place."""


MemberT = TypeVar("MemberT", bound=Member)


class Places(Generic[MemberT]):
    """A newcomer that finds no place takes one of the holder's own, else one of the holder that has most.

    Args:
        most: places of all strangers together.
        per_holder: places of one holder.
        reserve: places of all known holders together.
        clock: monotonic.
    """

    def __init__(self, most: int, per_holder: int, reserve: int, clock: Callable[[], float] = time.monotonic) -> None:
        self._most, self._per_holder, self._reserve, self._clock = most, per_holder, reserve, clock
        self._members: dict[MemberT, None] = {}
        self._allowance = Allowance(FLOOD_BURST, FLOOD_REFILL_S)
        self._flood, self._flood_until_s = "", float("-inf")

    def __iter__(self) -> Iterator[MemberT]:
        """Iterate over the members as they are now, which may leave meanwhile."""
        return iter(tuple(self._members))

    def enter(self, newcomer: MemberT) -> bool:
        """Give a newcomer a place, if need be another member's; false if no member of a full house gives way."""
        pool = [member for member in self._members if member.known == newcomer.known]
        own = [member for member in pool if member.holder == newcomer.holder]
        if len(own) >= self._per_holder:
            full = own
        elif len(pool) >= (self._reserve if newcomer.known else self._most):
            full = pool
        else:
            self._members[newcomer] = None
            return True
        places = Counter(member.holder for member in full)
        self._note_full(places.most_common(1)[0][0])
        ranked = [(-places[member.holder], rank, member) for member in full if (rank := member.rank) is not None]
        if not ranked:
            return False
        *_, last = min(ranked, key=lambda each: each[:2])
        self.leave(last)
        last.displace()
        self._members[newcomer] = None
        return True

    def leave(self, member: MemberT) -> None:
        """Free a member's place. Idempotent."""
        self._members.pop(member, None)

    @property
    def flooded_by(self) -> str:
        """The holder with the most places, where newcomers met a full house again and again; empty for no flood."""
        return self._flood if self._clock() < self._flood_until_s else ""

    def _note_full(self, holder: str) -> None:
        now_s = self._clock()
        if not self._allowance.take(now_s):
            self._flood, self._flood_until_s = holder, now_s + FLOOD_S

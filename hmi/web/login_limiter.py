"""Login rate limiter: after several wrong PINs each further try is delayed, longer and longer."""

import time
from collections import OrderedDict
from collections.abc import Callable

from station.serving.guard import is_this_machines

FREE_TRIES = 4
"""Wrong PINs in a row without a delay. An estimate."""
FIRST_WAIT_S = 5.0
"""Delay after one more wrong PIN; each further one doubles it. An estimate."""
LONGEST_WAIT_S = 900.0
"""Upper limit of the delay. An estimate."""
CLEARED_AFTER_S = 3600.0
"""Time since the last wrong PIN after which the count begins anew. An estimate."""
_MOST_KEYS = 1000


class LoginRateLimiter:
    """Wrong PINs by person and by address; a right PIN clears the counts of its keys.

    An address where a person has logged in before counts that person's tries apart, and so does the station's own
    screen: wrong PINs from elsewhere do not delay a person there.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._wrong: OrderedDict[str, tuple[int, float]] = OrderedDict()
        self._logged_in: OrderedDict[tuple[str, str], None] = OrderedDict()

    def knows(self, address: str) -> bool:
        """Return whether an address is the station's own screen, or a person has logged in there before."""
        return is_this_machines(address) or any(where == address for _, where in self._logged_in)

    def wait_s(self, name: str, address: str) -> float:
        """Return the delay of the next try, 0 for none; the name is empty for who does not exist."""
        return max(self._wait_s(key) for key in self._keys(name, address))

    def tried(self, name: str, address: str) -> None:
        """Count a try before its PIN is checked: as wrong until `right`, so that parallel tries gain nothing."""
        for key in self._keys(name, address):
            tries, at_s = self._wrong.pop(key, (0, 0.0))
            tries = 0 if self._clock() - at_s > CLEARED_AFTER_S else tries
            self._wrong[key] = tries + 1, self._clock()
        while len(self._wrong) > _MOST_KEYS:
            self._wrong.popitem(last=False)

    def right(self, name: str, address: str) -> None:
        """Clear the counts after a right PIN, and remember where this person has logged in."""
        for key in self._keys(name, address):
            self._wrong.pop(key, None)
        self._logged_in.pop((name, address), None)
        self._logged_in[name, address] = None
        while len(self._logged_in) > _MOST_KEYS:
            self._logged_in.popitem(last=False)

    def _keys(self, name: str, address: str) -> tuple[str, ...]:
        here = f"{name} at {address}"
        if (name, address) in self._logged_in:
            return (here,)
        return (here if is_this_machines(address) else f"name {name}", f"address {address}")

    def _wait_s(self, key: str) -> float:
        tries, at_s = self._wrong.get(key, (0, 0.0))
        if tries <= FREE_TRIES:
            return 0.0
        wait_s = min(LONGEST_WAIT_S, FIRST_WAIT_S * 2 ** min(20, tries - FREE_TRIES - 1))
        return max(0.0, at_s + wait_s - self._clock())

"""Login rate limiter: after several wrong PINs each further try is delayed, longer and longer."""

import time
from collections import OrderedDict
from collections.abc import Callable

FREE_TRIES = 4
FIRST_WAIT_S = 5.0
LONGEST_WAIT_S = 900.0
CLEARED_AFTER_S = 3600.0
_MOST_KEYS = 1000


class LoginRateLimiter:
    """Wrong PINs by name and by browser's address; a right PIN clears the count of its keys.

    Args:
        clock: monotonic.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._wrong: OrderedDict[str, tuple[int, float]] = OrderedDict()

    def wait_s(self, *keys: str) -> float:
        """Return the delay of the next try; 0 for none.

        Args:
            keys: the name and the address of the try.
        """
        return max((self._wait_s(key) for key in keys), default=0.0)

    def tried(self, *keys: str) -> None:
        """Count a try before its PIN is checked: as wrong until `right`, so that parallel tries gain nothing.

        Args:
            keys: as above.
        """
        for key in keys:
            tries, at_s = self._wrong.pop(key, (0, 0.0))
            tries = 0 if self._clock() - at_s > CLEARED_AFTER_S else tries
            self._wrong[key] = tries + 1, self._clock()
        while len(self._wrong) > _MOST_KEYS:
            self._wrong.popitem(last=False)

    def right(self, *keys: str) -> None:
        """Clear the counts after a right PIN.

        Args:
            keys: as above.
        """
        for key in keys:
            self._wrong.pop(key, None)

    def _wait_s(self, key: str) -> float:
        tries, at_s = self._wrong.get(key, (0, 0.0))
        if tries <= FREE_TRIES:
            return 0.0
        wait_s = min(LONGEST_WAIT_S, FIRST_WAIT_S * 2 ** min(20, tries - FREE_TRIES - 1))
        return max(0.0, at_s + wait_s - self._clock())

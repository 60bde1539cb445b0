"""The faults that can be switched on in a twin's device while it runs."""

from enum import StrEnum

LARGEST_AMOUNT = 1000.0


class CommonFault(StrEnum):
    """Faults that every device knows."""

    OFF = "off"
    """Gone: connections refused or cut."""
    STUCK = "stuck"
    """Alive on the wire, but its state never changes again."""
    GARBAGE = "garbage"
    """Answers that are no protocol at all."""
    WRONG = "wrong"
    """Well-formed answers with wrong values."""
    SLOW = "slow"
    """Does everything at a fraction of its speed."""
    DELAYED = "delayed"
    """Answers late."""
    INTERMITTENT = "intermittent"
    """Comes and goes."""


class FaultBoard:
    """Switches of one device's faults: the device reads them; tests, the console and the command line set them."""

    def __init__(self, device: str, own: tuple[str, ...] = ()) -> None:
        self.device = device
        self.known: tuple[str, ...] = (*CommonFault, *own)
        self._active: dict[str, float] = {}
        self._begun: set[str] = set()

    def set(self, fault: str, amount: float = 1.0) -> None:
        """Switch a fault on.

        Args:
            fault: one of `known`.
            amount: its strength in the unit that the device documents (seconds for `delayed`, …), 0 to 1000.

        Raises:
            ValueError: the device has no such fault, or the amount is beyond its bounds.
        """
        self._check(fault)
        # In this form NaN is refused too: every comparison with it is false.
        if not 0 <= amount <= LARGEST_AMOUNT:
            raise ValueError(f"amount: expected a number from 0 to {LARGEST_AMOUNT:g}, found {amount!r}")
        if fault not in self._active:
            self._begun.add(fault)
        self._active[fault] = amount

    def clear(self, fault: str | None = None) -> None:
        """Switch one fault off by its name, or for None all of them.

        Raises:
            ValueError: the device has no such fault.
        """
        if fault is None:
            self._active.clear()
        else:
            self._check(fault)
            self._active.pop(fault, None)

    def _check(self, fault: str) -> None:
        if fault not in self.known:
            raise ValueError(f"{self.device} has no fault {fault!r}; it knows: {', '.join(self.known)}")

    def active(self, fault: str) -> bool:
        """Return whether a fault is switched on."""
        return fault in self._active

    def amount(self, fault: str) -> float:
        """A fault's strength, 0.0 where it is off."""
        return self._active.get(fault, 0.0)

    def gone(self, now_s: float, *own: str) -> bool:
        """Return whether the device is unreachable: off, by a fault of its own, or as `intermittent` comes and goes."""
        if any(map(self.active, (CommonFault.OFF, *own))):
            return True
        period_s = self.amount(CommonFault.INTERMITTENT)
        return period_s > 0 and now_s % period_s >= period_s / 2

    def take_new(self) -> frozenset[str]:
        """The faults switched on since the last call, also those that are off again."""
        begun = frozenset(self._begun)
        self._begun.clear()
        return begun

    def snapshot(self) -> dict[str, float]:
        """All faults that are on, with their strengths."""
        return dict(self._active)

"""Tables of the sorting run: both errors by fruit and severity, with intervals, and what each practice is worth."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from math import sqrt
from statistics import median

from station.twin.damage import Severity

from .cycle import Inspected, Practice
from .specimens import KINDS, SOUND

PRACTICES = {
    "all of it": Practice(),
    "a size class in place of the length": Practice(size="class"),
    "no size": Practice(size="none"),
    "no centring": Practice(centring=False),
    "no second press": Practice(second_press=False),
    "no size, no centring, no second press": Practice(size="none", centring=False, second_press=False),
    "all, but a unit that was never calibrated": Practice(calibrated=False),
}
"""What of the station is used, in the order of the table."""

_95_PERCENT = 1.959964
"""Standard deviations of a normal distribution on either side of its mean."""


def wilson(count: int, of: int) -> tuple[float, float]:
    """The 95 % interval of a share (Wilson, Journal of the American Statistical Association 22 (1927) 209).

    Args:
        count: how many have it.
        of: how many were checked, at least 1.
    """
    squared = _95_PERCENT**2
    share = count / of
    middle = (share + squared / (2 * of)) / (1 + squared / of)
    half = _95_PERCENT / (1 + squared / of) * sqrt(share * (1 - share) / of + squared / (4 * of**2))
    return max(0.0, middle - half), min(1.0, middle + half)


def is_error(one: Inspected) -> bool:
    """Return whether a fruit went the wrong way: a sound one that did not pass, a damaged one that did.

    Args:
        one: the fruit.
    """
    return (one.outcome == "PASS") != (one.task.group == SOUND)


def share(group: Sequence[Inspected]) -> str:
    """Return the share of a group that went the wrong way, with its interval, as a table's cell.

    Args:
        group: the fruit; may be none.
    """
    if not group:
        return "not run"
    return share_of(sum(map(is_error, group)), len(group))


def share_of(count: int, of: int) -> str:
    """A share with its interval.

    Args:
        count: how many have it.
        of: how many were checked, at least 1.
    """
    low, high = wilson(count, of)
    return f"{count} of {of}, {100 * count / of:.1f} % ({100 * low:.1f} to {100 * high:.1f})"


def errors(inspected: Iterable[Inspected]) -> list[str]:
    """Both errors of each fruit: what line and grower lose, and what reaches the customer.

    Args:
        inspected: by one practice.
    """
    groups = _grouped(inspected)
    lines = header("fruit", "sound diverted", *(f"{each} damage passed" for each in Severity))
    for kind in KINDS:
        lines.append(row(kind, *(share(groups.get((kind, group), [])) for group in (SOUND, *Severity))))
    return lines


def worth(by_practice: Mapping[str, Iterable[Inspected]]) -> list[str]:
    """Return a table of both errors by practice: the worth of size, centring, second press and calibration.

    Args:
        by_practice: the same fruit, inspected by each practice.
    """
    lines = header("used", "fruit", "sound diverted", "severe passed", "mild passed", "closings on a sound fruit")
    for name, inspected in by_practice.items():
        groups = _grouped(inspected)
        for kind in KINDS:
            of_kind = [groups.get((kind, group), []) for group in (SOUND, Severity.SEVERE, Severity.MILD)]
            if sound := of_kind[0]:
                closings = sum(one.closings for one in sound) / len(sound)
                lines.append(row(name, kind, *map(share, of_kind), f"{closings:.2f}"))
    return lines


def diverted_why(inspected: Iterable[Inspected]) -> list[str]:
    """The reasons of sound fruit that were diverted; a fruit may have several.

    Args:
        inspected: by one practice.
    """
    groups = _grouped(inspected)
    lines = header("fruit", "sound, diverted", "reasons")
    for kind in KINDS:
        wrong = [one for one in groups.get((kind, SOUND), []) if is_error(one)]
        reasons = Counter(reason.value for one in wrong for reason in one.reasons)
        listed = ", ".join(f"{reason} {count}" for reason, count in reasons.most_common()) or "none"
        lines.append(row(kind, len(wrong), listed))
    return lines


def spared(before: Iterable[Inspected], after: Iterable[Inspected]) -> list[str]:
    """Most force, steps and their seconds on sound fruit, pressed to the early stop and until decided.

    Args:
        before: as placed, to the early stop.
        after: as placed, until decided.
    """
    lines = header("fruit", "pressed", "most force, N", "median, N", "steps a fruit", "their seconds")
    ways = (("to the early stop", _grouped(before)), ("until decided", _grouped(after)))
    for kind in KINDS:
        for name, groups in ways:
            if sound := groups.get((kind, SOUND), []):
                forces = [one.most_force_n for one in sound]
                steps = sum(one.steps for one in sound) / len(sound)
                seconds = sum(one.steps_s for one in sound) / len(sound)
                cells = f"{max(forces):.2f}", f"{median(forces):.2f}", f"{steps:.2f}", f"{seconds:.2f}"
                lines.append(row(kind, name, *cells))
    return lines


def exchange(limits: str, inspected: Iterable[Inspected]) -> str:
    """A line of how one error is exchanged for the other, below `EXCHANGE`.

    Args:
        limits: the area limits, mm².
        inspected: sound and mildly damaged fruit of one kind, by one practice.
    """
    groups = {group: fruit for (_, group), fruit in _grouped(inspected).items()}
    return row(limits, *(share(groups.get(group, [])) for group in (SOUND, Severity.MILD)))


def _grouped(inspected: Iterable[Inspected]) -> dict[tuple[str, str], list[Inspected]]:
    groups: dict[tuple[str, str], list[Inspected]] = {}
    for one in inspected:
        groups.setdefault((one.task.kind, one.task.group), []).append(one)
    return groups


def header(*names: object) -> list[str]:
    """A table's first two lines.

    Args:
        names: of its columns.
    """
    return [row(*names), "|" + "---|" * len(names)]


def row(*cells: object) -> str:
    """A table's line.

    Args:
        cells: one for each column.
    """
    return "| " + " | ".join(str(cell) for cell in cells) + " |"


EXCHANGE = header("limits, mm²", "sound diverted", "mild damage passed")
"""Head of the table whose lines `exchange` gives."""

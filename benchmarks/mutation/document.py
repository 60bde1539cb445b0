"""docs/mutation.md: of each package how many mutants were killed, which are equivalent, and which survived."""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from scipy.stats import binomtest

from .results import Outcome, equal
from .rooms import ROOMS
from .runner import Fate

DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "mutation.md"


def page(known: Mapping[str, Outcome]) -> str:
    """Return the document."""
    reasons = equal()
    rows, alive = [], []
    for name in ROOMS:
        if name not in known:
            continue
        outcome = known[name]
        same = [each for each in outcome.alive if each in reasons]
        left = [each for each in outcome.alive if each not in reasons]
        killed = outcome.counts.get(Fate.KILLED, 0) + outcome.counts.get(Fate.LATE, 0)
        count = killed + len(outcome.alive)
        unmet = outcome.counts.get(Fate.NO_MODULE, 0)
        sampled = count + unmet < outcome.of
        interval = binomtest(killed, count).proportion_ci(method="wilson")
        shown = f"{100 * interval.low:.1f} to {100 * interval.high:.1f} %" if sampled else "all tested"
        rows.append(
            f"| {name} | {outcome.of:,} | {unmet:,} | {count:,} | {killed:,} | {len(same)} | {len(left)} "
            f"| {100 * killed / count:.1f} % | {shown} "
            f"| {100 * killed / (count - len(same)):.1f} % | {outcome.commit} |"
        )
        if left:
            alive += ["", f"### {name}", "", *(f"- `{each}`" for each in left)]
    why = Counter(reasons[each] for outcome in known.values() for each in outcome.alive if each in reasons)
    rooms = [
        f"| {name} | {_code(room.modules)} | {_code(room.tests)} |" for name, room in ROOMS.items() if name in known
    ]
    return "\n".join([
        "# Mutation testing",
        "",
        "Written by `./run bench mutation`. A mutant is the code with one small change: `<` for `<=`, `and` for `or`,",
        "a number one more, a call, an argument or a row of a table left out. Each mutant is run against its package's",
        "own tests; one has to fail. Property tests take 10 examples, always the same ones, so a run can be repeated.",
        "",
        ("| package | mutants | not importable | tested | killed | equivalent | survived | killed of all tested "
        "| 95 % interval | of those not equivalent | commit |"),
        f"|{'---|' * 11}",
        *rows,
        "",
        "A mutant that cannot be imported is not tested. Where only every N-th mutant was tested (`--every N`), the",
        "interval is Wilson's for all mutants of the package. Where survivors then got tests and were run again",
        "(`--alive`), the figure is better than that of the untested mutants. *Equivalent* mutants do not change the",
        "behaviour: each was examined, and is listed with its reason in `benchmarks/mutation/equal.toml`.",
        "[Decision 81](decisions/0081-mutation-testing-of-the-pure-rooms.md) has the reasons for a runner of our own.",
        "",
        "| package | modules | tests |",
        "|---|---|---|",
        *rooms,
        *(["", "## Equivalent", "", "| mutants | why they change nothing |", "|---|---|"] if why else []),
        *(f"| {count} | {reason} |" for reason, count in why.most_common()),
        *(["", "## Survived"] if alive else []),
        *alive,
        "",
        "## Again",
        "",
        "```",
        "./run bench mutation  # all packages",
        "./run bench mutation --room judge --every 5  # a sample, for a busy machine",
        "./run bench mutation --room judge --alive  # after tests were added: those that survived",
        "```",
        "",
    ])  # fmt: skip


def _code(names: tuple[str, ...]) -> str:
    return ", ".join(f"`{name}`" for name in names)

"""docs/mutation.md: of each room how many mutants died, which change nothing, and which live."""

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
        shown = f"{100 * interval.low:.1f} to {100 * interval.high:.1f} %" if sampled else "all met"
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
        "a number one more, a call, an argument or a row of a table left out. The room's own tests meet each mutant;",
        "one of them has to fail. Property tests take 10 examples, always the same ones, so a run can be repeated.",
        "",
        ("| room | mutants | not importable | met | killed | equal | alive | killed of all met | 95 % interval "
        "| of those not equal | commit |"),
        f"|{'---|' * 11}",
        *rows,
        "",
        "A mutant that cannot be imported is met by no test. Where the others were sampled evenly (`--every N`), the",
        "interval is Wilson's for the share of all; a sample whose survivors got tests and were met again (`--alive`)",
        "is better than the rest of its room. *Equal* ones change nothing that anyone could see: each was examined,",
        "and is listed with its reason in `benchmarks/mutation/equal.toml`. Why a runner of our own:",
        "[decision 81](decisions/0081-mutation-testing-of-the-pure-rooms.md).",
        "",
        "| room | modules | tests |",
        "|---|---|---|",
        *rooms,
        *(["", "## Equal", "", "| mutants | why they change nothing |", "|---|---|"] if why else []),
        *(f"| {count} | {reason} |" for reason, count in why.most_common()),
        *(["", "## Alive"] if alive else []),
        *alive,
        "",
        "## Again",
        "",
        "```",
        "./run bench mutation  # all rooms",
        "./run bench mutation --room judge --every 5  # a sample, for a busy machine",
        "./run bench mutation --room judge --alive  # after tests were added: those that lived",
        "```",
        "",
    ])  # fmt: skip


def _code(names: tuple[str, ...]) -> str:
    return ", ".join(f"`{name}`" for name in names)

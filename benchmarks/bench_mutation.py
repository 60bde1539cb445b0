"""Mutation testing of the pure rooms: each small change of their code has to fail their own tests.

`./run bench mutation` takes all rooms in turn, `--room NAME` one (repeatable), `--alive` only the mutants that lived
the time before, after tests were added, `--every N` one mutant in N. Writes docs/mutation.md from what is known of
every room.
"""

import argparse
import ast
import subprocess
import sys
import time
from collections import Counter

from mutation.document import DOCUMENT, page
from mutation.operators import mutants
from mutation.results import Outcome, load, store
from mutation.rooms import ROOMS, Room
from mutation.runner import ROOT, Changed, Fate, fates


def trees(room: Room) -> list[Changed]:
    """Every mutant of a room, with its module's file and tree."""
    made: list[Changed] = []
    for module in room.modules:
        path = ROOT / f"{module.replace('.', '/')}.py"
        tree = ast.parse(path.read_text(encoding="utf-8"))
        made += [Changed(mutant, path, tree) for mutant in mutants(module, tree)]
    return made


def run(name: str, before: Outcome | None, *, only_alive: bool, every: int) -> Outcome:
    """Let a room's tests meet its mutants.

    Args:
        name: of the room.
        before: what is known of it.
        only_alive: those that lived before; what died then counts as it was.
        every: one mutant in so many.
    """
    room, began_s = ROOMS[name], time.monotonic()
    todo, counts = trees(room), Counter[str]()
    count = len(todo)
    if only_alive and before is not None:
        lived = set(before.alive)
        counts = Counter(before.counts)
        counts[Fate.ALIVE] = 0
        todo = [each for each in todo if each.mutant.name in lived]
    else:
        todo = todo[::every]
    alive: list[str] = []
    for mutant, fate in fates(todo, room.tests):
        counts[fate] += 1
        if fate is Fate.ALIVE:
            alive.append(mutant.name)
            print(f"{name}: {sum(counts.values())}, line {mutant.line}: {mutant.name}", file=sys.stderr, flush=True)
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.strip()  # fmt: skip
    print(f"{name}: {dict(counts)} in {time.monotonic() - began_s:.0f} s", file=sys.stderr)
    return Outcome(dict(counts), sorted(alive), commit, count)


def main() -> None:
    """Run the rooms that are requested, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--room", action="append", choices=sorted(ROOMS))
    parser.add_argument("--alive", action="store_true")
    parser.add_argument("--every", type=int, default=1, metavar="N")
    options = parser.parse_args()
    rooms = options.room or list(ROOMS)
    if len(rooms) > 1:  # each in a process of its own, which has not imported what is changed
        flags = [*(["--alive"] if options.alive else []), "--every", str(options.every)]
        for name in rooms:
            subprocess.run([sys.executable, __file__, "--room", name, *flags], check=True)
        return
    [name] = rooms
    outcome = run(name, load().get(name), only_alive=options.alive, every=options.every)
    known = load() | {name: outcome}
    store(known)
    DOCUMENT.write_text(page(known), encoding="utf-8")


if __name__ == "__main__":
    main()

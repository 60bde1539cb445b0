"""Benchmarks against those of an earlier revision, in the same run: `./run bench --against REVISION NAME [NAME ...]`.

Each revision runs its own benchmark on its own code, with this environment's packages, one after the other; called
again, the other one first, which adds a pair. Writes `docs/benchmarks-earlier.md`; a figure of which the earlier page
has no row is left out.
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from benchmarks.revision import checked_out
from benchmarks.summary import BENCHMARKS, ROOT, figure

DOCUMENT = ROOT / "docs" / "benchmarks-earlier.md"
FOUND = Path(__file__).with_name("against.json")
INTRODUCTION = """\
# Against an earlier revision

`./run bench --against REVISION NAME [NAME ...]` writes this page: each benchmark as it was at that revision, on the
code of that revision, and at once the present one on the same machine. Called again it adds a pair, the present one
first. A difference that is no larger than between two runs of one revision is the machine's.
"""


def figures(root: Path, name: str) -> dict[str, str]:
    """Return a benchmark's figures by what they are, from the page below a checkout; those that it lacks left out."""
    entry, found = BENCHMARKS[name], {}
    text = (root / "docs" / entry["page"]).read_text("utf-8")
    for what, column, row, *_peers in entry.get("figures", ()):
        try:
            found[what] = figure(text, what, column, row)[1]
        except LookupError:
            continue
    return found


def run(revision: str, names: Sequence[str], run_now: Callable[[str], int]) -> int:
    """Run benchmarks of a revision and of now in turn, add what they found to what is known, and write the page.

    Args:
        run_now: runs a benchmark of now by its name, and returns its exit code.

    Returns:
        0 where all succeeded, else another number at the first that failed; what ran before it is stored.

    Raises:
        subprocess.CalledProcessError: there is no such revision.
    """
    known = read()
    with checked_out(revision) as tree:
        places = {"earlier": tree, "now": ROOT}
        for name in names:
            pairs = known.get(name, {})
            if pairs.get("revision") != revision:
                pairs = {"revision": revision, "earlier": [], "now": []}
            found = {}
            for turn in places if len(pairs["now"]) % 2 == 0 else reversed(places):
                print(f"bench: {name}, {turn}", file=sys.stderr, flush=True)
                code = run_now(name) if turn == "now" else _run_earlier(tree, name)
                if code:
                    return code
                found[turn] = figures(places[turn], name)
            known[name] = {"revision": revision, **{turn: [*pairs[turn], found[turn]] for turn in places}}
            FOUND.write_text(json.dumps(known, indent=2, sort_keys=True, ensure_ascii=False) + "\n", encoding="utf-8")
            DOCUMENT.write_text(markdown(read()), encoding="utf-8")
    return 0


def _run_earlier(tree: Path, name: str) -> int:
    command = [sys.executable, str(tree / "benchmarks" / f"bench_{name}.py")]
    return subprocess.run(command, cwd=tree, env={**os.environ, "PYTHONPATH": str(tree)}, check=False).returncode


def markdown(known: dict[str, Any]) -> str:
    """Return the page.

    Args:
        known: by benchmark the revision, and of `earlier` and `now` the figures of each run.
    """
    lines = ["| benchmark | revision | | earlier | now |", "|---|---|---|---|---|"]
    for name, each in known.items():
        both = [what for what in each["now"][0] if all(what in run for run in each["earlier"])]
        lines += [
            f"| `{name}` | {each['revision']} | {what} | "
            f"{'; '.join(run[what] for run in each['earlier'])} | {'; '.join(run[what] for run in each['now'])} |"
            for what in both
        ]
    return "\n".join([INTRODUCTION, *lines]) + "\n"


def read() -> dict[str, Any]:
    """Return what is known, by benchmark, as `markdown` takes it."""
    return json.loads(FOUND.read_text("utf-8")) if FOUND.exists() else {}

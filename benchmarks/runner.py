"""Runner of the benchmarks: chosen ones or all in turn, and `docs/benchmarks.md` from the pages that they wrote.

A whole run, without options, is noted in `benchmarks/runs.json`.
"""

import ast
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from benchmarks import against, summary
from benchmarks.revision import commit
from benchmarks.summary import BENCHMARKS

FOLDER = Path(__file__).resolve().parent
USAGE = """usage: ./run bench                  all but the long ones, in turn; then docs/benchmarks.md is written
       ./run bench --all            all of them
       ./run bench NAME [NAME ...]  these
       ./run bench NAME OPTIONS     one, its own way (--help lists its options)
       ./run bench --against REVISION NAME [NAME ...]
                                    these in turn with those of an earlier revision
       ./run bench --list           what there is
"""


def report(message: str) -> None:
    """Report progress, apart from a benchmark's own output."""
    print(f"bench: {message}", file=sys.stderr, flush=True)


def listing(runs: dict[str, dict[str, Any]]) -> str:
    """Return a line for each benchmark: how long it took the last time, and what it measures."""
    lines = []
    for name in sorted(BENCHMARKS):
        source = (FOLDER / f"bench_{name}.py").read_text("utf-8")
        about = (ast.get_docstring(ast.parse(source)) or "").partition("\n")[0]
        took = f"{runs[name]['minutes']} min" if name in runs else "-"
        lines.append(f"{name:12} {'long' if BENCHMARKS[name].get('long') else '':5} {took:>9}  {about}")
    return "\n".join(lines)


def run(names: Sequence[str], options: Sequence[str] = ()) -> int:
    """Run benchmarks in turn, go on after a failure, and name those that failed.

    Returns:
        0 where all succeeded, 1 where one failed, 130 where Ctrl-C ended the benchmark that ran.
    """
    interrupted: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _frame: interrupted.append(number))  # the benchmark gets it too
    runs, measured, failed = summary.read_runs(), commit(), []
    timed = [float(runs[name]["minutes"]) for name in names if name in runs]
    report(f"{len(names)} to run; the {len(timed)} that were timed before took {sum(timed):.1f} min")
    for number, name in enumerate(names, 1):
        before = f"{os.getloadavg()[0]:.1f}"
        took = f"took {runs[name]['minutes']} min the last time" if name in runs else "not timed yet"
        report(f"{number} of {len(names)}: {name}, load {before}; {took}")
        began_s = time.monotonic()
        code = subprocess.run([sys.executable, str(FOLDER / f"bench_{name}.py"), *options], check=False).returncode
        minutes = f"{(time.monotonic() - began_s) / 60:.1f}"
        if interrupted:
            report(f"{name} was interrupted")
            return 130
        report(f"{name} {f'FAILED with exit code {code}' if code else 'is done'} after {minutes} min")
        if code:
            failed.append(name)
        elif not options:
            day = datetime.now(UTC).date().isoformat()
            runs[name] = {"date": day, "commit": measured, "minutes": minutes, "load": before}
            summary.RUNS.write_text(json.dumps(runs, indent=2, sort_keys=True) + "\n", encoding="utf-8")
        try:
            summary.write()
        except LookupError as error:
            report(f"docs/benchmarks.md cannot be written: {error}")
            failed.append(name)
    if failed:
        report(f"failed: {', '.join(dict.fromkeys(failed))}")
    return 1 if failed else 0


def main(arguments: Sequence[str]) -> int:
    """Run what was requested, or list what there is."""
    # As `station/__init__.py` has it for every process of the station: a benchmark may import numpy before, and two
    # processes whose matrix products have two threads each on two cores wait for each other most of their time.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if list(arguments) == ["--list"]:
        print(listing(summary.read_runs()))
        return 0
    if not arguments or list(arguments) == ["--all"]:
        return run([name for name in sorted(BENCHMARKS) if arguments or not BENCHMARKS[name].get("long")])
    if set(arguments) <= set(BENCHMARKS):
        return run(arguments)
    if arguments[0] == "--against" and arguments[2:] and set(arguments[2:]) <= set(BENCHMARKS):
        return against.run(arguments[1], arguments[2:], lambda name: run([name]))
    if arguments[0] in BENCHMARKS:
        return run(arguments[:1], arguments[1:])
    print(USAGE, file=sys.stdout if arguments[0] in {"-h", "--help", "help"} else sys.stderr)
    return 0 if arguments[0] in {"-h", "--help", "help"} else 2


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))

"""A fresh clone: the time that the demo takes, with making the environment, and that all checks and tests take.

Clones this checkout's last commit into a folder of its own, and writes the README's table.
"""

import os
import platform
import re
import subprocess
import tempfile
import time
from datetime import UTC, datetime
from pathlib import Path

from revision import commit
from sections import write

ROOT = Path(__file__).resolve().parents[1]
DOCUMENT = ROOT / "README.md"


def strangers_environment() -> dict[str, str]:
    """Return the environment variables without those that name this checkout's Python."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "VIRTUAL_ENV"))}
    programs = [each for each in environment.get("PATH", "").split(os.pathsep) if not each.startswith(str(ROOT))]
    return environment | {"PATH": os.pathsep.join(programs)}


def timed(clone: Path, *command: str) -> tuple[float, str]:
    """Run a command in a clone, and return its seconds and what it printed.

    Raises:
        SystemExit: it failed.
    """
    began_s, lines = time.monotonic(), []
    running = subprocess.Popen(
        command, cwd=clone, env=strangers_environment(), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    with running as process:
        for line in process.stdout or ():
            print(line, end="", flush=True)
            lines.append(line)
    if running.returncode:
        raise SystemExit(f"{' '.join(command)} ended with {running.returncode} in a fresh clone: nothing is written")
    return time.monotonic() - began_s, "".join(lines)


def total(text: str, what: str) -> int:
    """Return the sum of pytest's last lines: so many `passed` or `skipped`."""
    summaries = re.findall(r"^=+ (.*) in [\d.]+s.*$", text, re.MULTILINE)
    return sum(int(number) for each in summaries for number in re.findall(rf"(\d+) {what}", each))


def installing_s(text: str) -> int:
    """Return the seconds that `run` reports for the environment; 0 where it was there."""
    made = re.search(r"ready after (\d+) s", text)
    return int(made[1]) if made else 0


def main() -> None:
    """Clone, run the demo, then the tests."""
    load = os.getloadavg()[0]
    with tempfile.TemporaryDirectory() as folder:
        clone = Path(folder) / "fruit-station"
        subprocess.run(["git", "clone", "--quiet", str(ROOT), str(clone)], check=True)
        demo_s, demo = timed(clone, "./run", "demo", "--count", "3")
        test_s, tests = timed(clone, "./run", "test")
    cores = f"{os.cpu_count()} cores ({platform.machine()})"
    passed, skipped = total(tests, "passed"), total(tests, "skipped")
    lines = [
        "| in a fresh clone | took | of that, installing | result |",
        "|---|---|---|---|",
        f"| `./run demo --count 3` | {demo_s:.0f} s | {installing_s(demo)} s | |",
        f"| `./run test` | {test_s / 60:.1f} min | {installing_s(tests)} s | {passed:,} passed, {skipped} skipped |",
        "",
        f"{datetime.now(UTC).date().isoformat()}, commit {commit()}, {cores}, load {load:.1f} before.",
    ]
    write(DOCUMENT, {"fresh": lines})


if __name__ == "__main__":
    main()

"""Triggers in virtual time: PLC program, handshake, cycle and judge on one simulated clock, with faults at random.

Plays stories in several processes until so many triggers, or so many minutes, are over. A story that breaks a law is
shrunk to the least one that breaks it, and printed; `--story SEED` plays one again. With `--results FILE` every story's
end is stored there, one a line, and the same command goes on where it stopped; a story that broke a law is played anew.
Writes docs/virtual-time.md.
"""

import argparse
import functools
import json
import logging
import math
import os
import platform
import resource
import sys
import time
import zlib
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import sections
from virtual.laws import LAWS
from virtual.play import LAST_FRUITS, play
from virtual.story import Story, draw, shrink

from plc_interface.plc_simulator.program import Decision
from station.studies.workers import on_this_machine

DOCUMENT = Path(__file__).resolve().parents[1] / "docs" / "virtual-time.md"
FRUITS = 50
"""Of one story, but for the last ones."""
DECISIONS = tuple(str(decision) for decision in Decision)
MILLION = 1_000_000
"""Triggers that are the aim."""
_SHOWN_EVERY = 200
"""Stories between two lines of progress."""

Result = dict[str, Any]
"""A story's end, as a line of the results."""


def least(story: Story, law: str) -> Story:
    """The least story that breaks the same law."""

    def fails(other: Story) -> bool:
        broken = play(other).broken
        return broken is not None and broken.law == law

    return shrink(story, fails)


@functools.cache
def code() -> str:
    """A checksum of the product's code, which separates the stories that were played before and after a change."""
    root = DOCUMENT.parents[1]
    files = [file for room in ("plc_interface", "recipes", "station") for file in sorted((root / room).rglob("*.*"))]
    return f"{zlib.crc32(b''.join(file.read_bytes() for file in files if file.suffix in {'.py', '.yaml'})):08x}"


def played(seed: int) -> Result:
    """Play a story, in a process of its own or not, and return its end."""
    logging.disable(logging.CRITICAL)
    began_s, began_cpu_s = time.monotonic(), time.process_time()
    story = draw(seed, FRUITS)
    report = play(story)
    broken = report.broken
    return {
        "seed": seed,
        "triggers": report.triggers,
        "decided": report.decided,
        "by_trouble": report.by_trouble,
        "virtual_s": report.virtual_s,
        "took_s": time.monotonic() - began_s,
        "cpu_s": time.process_time() - began_cpu_s,
        "code": code(),
        "most_memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "broken": None if broken is None else [broken.law, str(broken), str(least(story, broken.law))],
    }


def run(triggers: int, seed: int, minutes: float, workers: int, results_file: Path | None) -> None:
    """Play stories, and write the page."""
    results: list[Result] = []
    if results_file is not None and results_file.exists():
        results = [json.loads(line) for line in results_file.read_text(encoding="utf-8").splitlines()]
    done = {result["seed"] for result in results if result["broken"] is None}
    seeds = range(seed, seed + math.ceil(triggers / (FRUITS + LAST_FRUITS)))
    ends_s = time.monotonic() + 60 * minutes
    for result in on_this_machine(played, [each for each in seeds if each not in done], workers):
        results.append(result)
        if results_file is not None:
            with results_file.open("a", encoding="utf-8") as file:
                file.write(json.dumps(result) + "\n")
        if result["broken"] is not None:
            print(f"story {result['seed']}: {result['broken'][1]}\n  least: {result['broken'][2]}", file=sys.stderr)
        if len(results) % _SHOWN_EVERY == 0:
            print(f"{len(results):,} of {len(seeds):,} stories, seed {result['seed']}", file=sys.stderr, flush=True)
        if time.monotonic() > ends_s:
            break
    sections.write(DOCUMENT, sections_of(results))


def sections_of(results: Sequence[Result]) -> dict[str, list[str]]:
    """The document's generated sections."""
    last = {result["seed"]: result for result in results}
    broken = [result for result in last.values() if result["broken"] is not None]
    mended = sum(result["broken"] is not None for result in results) - len(broken)
    by_law = Counter(result["broken"][0] for result in broken)
    decided, by_trouble = Counter[str](), dict[str, Counter[str]]()
    for result in last.values():
        decided.update(result["decided"])
        for name, each in result["by_trouble"].items():
            by_trouble.setdefault(name, Counter()).update(each)

    def total(what: str) -> float:
        return sum(result[what] for result in last.values())

    triggers, memory = total("triggers"), [result["most_memory_mb"] for result in results]
    codes = Counter(result["code"] for result in last.values())
    return {
        "played": [
            f"- **{triggers:,}** triggers, {triggers / MILLION:.1%} of the million that is the aim.",
            f"- {len(last):,} stories of {FRUITS} fruits and {LAST_FRUITS} sound ones at the end, seeds {min(last)} to",
            f"  {max(last)}; {total('virtual_s') / 3600:,.1f} hours of the line.",
            f"- {triggers / total('cpu_s') * 60:,.0f} triggers per minute of one core's time.",
            f"  Wall clock: {triggers / total('took_s') * 60:,.0f} per minute of a process",
            f"  ({platform.machine()}, {os.cpu_count()} cores; other work ran beside it).",
            f"- {max(memory[:_SHOWN_EVERY]):.0f} MB was the most that a process held in the first {_SHOWN_EVERY}",
            f"  stories, {max(memory):.0f} MB in all.",
            f"- Stories by the checksum of the code: {', '.join(f'{name}: {n:,}' for name, n in codes.items())}.",
            f"- Stories that broke a law before a fix and pass since: {mended}.",
            "- " + ", ".join(f"{decided[name]:,} {name}" for name in DECISIONS) + ".",
        ],
        "laws": [
            "| law | stories that broke it |",
            "|---|---|",
            *(f"| {law} | {by_law[law]} |" for law in LAWS),
            *(f"\n`{result['broken'][2]}`: {result['broken'][1]}" for result in broken),
        ],
        "troubles": [
            "| trouble | " + " | ".join(DECISIONS) + " |",
            "|---|" + "---|" * len(DECISIONS),
            *(
                f"| {name} | " + " | ".join(f"{each[decision]:,}" for decision in DECISIONS) + " |"
                for name, each in sorted(by_trouble.items())
            ),
        ],
    }


def again(seed: int) -> None:
    """Play one story, and shrink it where it breaks a law."""
    story = draw(seed, FRUITS)
    report = play(story)
    for trouble in story.troubles:
        print(trouble)
    print(dict(report.decided), report.broken or "no law is broken")
    if report.broken is not None:
        print("least:", least(story, report.broken.law))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--triggers", type=int, default=MILLION)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=60.0, help="no story begins after them")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="processes")
    parser.add_argument("--results", type=Path, metavar="FILE", help="keep every story's end, and go on from them")
    parser.add_argument("--story", type=int, metavar="SEED")
    options = parser.parse_args()
    logging.disable(logging.CRITICAL)
    if options.story is not None:
        again(options.story)
    else:
        run(options.triggers, options.seed, options.minutes, options.workers, options.results)

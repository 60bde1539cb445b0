"""Timing-bound tests in rounds: which tests these are, and the results of the stored rounds, as parts of a page."""

import ast
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TypedDict

_CLOCK = re.compile(
    r"monotonic\(\)|perf_counter|asyncio\.timeout|(deadline|timeout|stale_after|lost_after|limit)_s="
    r"|\b(until|eventually)\("
)


class Round(TypedDict):
    """One run of all the tests."""

    date: str
    commit: str
    seed: int
    """Of the order."""
    tests: int
    failed: list[str]
    minutes: float
    load: float
    """Mean of the machine's load average meanwhile."""


def timing_bound(folder: Path) -> list[str]:
    """Return a folder's tests that read a clock, set a deadline, or wait within one: each as pytest names it."""
    found = []
    for file in sorted(folder.rglob("test_*.py")):
        text = file.read_text("utf-8")
        found += [
            f"{folder.name}/{file.relative_to(folder)}::{each.name}"
            for each in ast.parse(text).body
            if isinstance(each, ast.FunctionDef)
            and each.name.startswith("test_")
            and _CLOCK.search(ast.get_source_segment(text, each) or "")
        ]
    return found


def played(rounds: Sequence[Round], aim: int, machine: str) -> list[str]:
    """Return what was run, in lines of the page."""
    loads, latest = [each["load"] for each in rounds], rounds[-1]
    return [
        f"- **{len(rounds)}** of the {aim} rounds that are the aim, seeds {rounds[0]['seed']} to {latest['seed']};",
        f"  all tests passed in {sum(not each['failed'] for each in rounds)}.",
        f"- {latest['tests']} tests in the last round;",
        f"  {sum(each['tests'] for each in rounds):,} runs of a test in all, of which",
        f"  {sum(len(each['failed']) for each in rounds)} failed.",
        f"- {sum(each['minutes'] for each in rounds):.0f} minutes, load {min(loads):.1f} to {max(loads):.1f} on",
        f"  {machine}.",
    ]


def failures(rounds: Sequence[Round]) -> list[str]:
    """Return a table of the tests that failed, and of the rounds in which they passed since."""
    lines = ["| test | failed | in the round | rounds passed since |", "|---|---|---|---|"]
    for test in sorted({test for each in rounds for test in each["failed"]}):
        failed = [number for number, each in enumerate(rounds, 1) if test in each["failed"]]
        numbers = ", ".join(map(str, failed))
        lines.append(f"| `{test}` | {len(failed)} | {numbers} | {len(rounds) - failed[-1]} |")
    return lines

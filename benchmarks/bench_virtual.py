"""Triggers in virtual time: PLC program, handshake, cycle and judge on one simulated clock, with faults at random.

Plays stories until so many triggers, or so many minutes, are over. A story that breaks a law is shrunk to the least one
that breaks it, and printed; `--story SEED` plays one again. Writes docs/virtual-time.md.
"""

import argparse
import logging
import os
import platform
import sys
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from virtual.inspection import ends_steps, judged
from virtual.laws import LAWS
from virtual.play import Report, play
from virtual.story import Story, draw, shrink

from plc_interface.plc_simulator.program import Decision

DOCUMENT = Path(__file__).resolve().parents[1] / "docs" / "virtual-time.md"
FRUITS = 50
"""Of one story, but for the last ones."""
DECISIONS = tuple(str(decision) for decision in Decision)


def least(story: Story, law: str) -> Story:
    """The least story that breaks the same law."""

    def fails(other: Story) -> bool:
        broken = play(other).broken
        return broken is not None and broken.law == law

    return shrink(story, fails)


def run(triggers: int, seed: int, minutes: float) -> None:
    """Play stories, and write the page."""
    began_s, began_cpu_s = time.monotonic(), time.process_time()
    total, broken, stories, virtual_s = Report(), Counter[str](), 0, 0.0
    failures: list[tuple[Story, str]] = []
    while total.triggers < triggers and time.monotonic() - began_s < 60 * minutes:
        story = draw(seed + stories, FRUITS)
        report = play(story)
        stories += 1
        total.triggers += report.triggers
        total.decided += report.decided
        virtual_s += report.virtual_s
        for name, decided in report.by_trouble.items():
            total.by_trouble.setdefault(name, Counter()).update(decided)
        if report.broken is not None:
            broken[report.broken.law] += 1
            shrunk = least(story, report.broken.law)
            failures.append((shrunk, str(report.broken)))
            print(f"story {story.seed}: {report.broken}\n  least: {shrunk}", file=sys.stderr)
    took_s = time.monotonic() - began_s
    lines = page(total, broken, failures, (seed, stories), (virtual_s, took_s, time.process_time() - began_cpu_s))
    DOCUMENT.write_text("\n".join(lines) + "\n", encoding="utf-8")


def page(
    total: Report,
    broken: Counter[str],
    failures: Sequence[tuple[Story, str]],
    seeds: tuple[int, int],
    times_s: tuple[float, float, float],
) -> list[str]:
    """The document's lines."""
    seed, stories = seeds
    virtual_s, took_s, cpu_s = times_s
    presses = judged.cache_info().misses + ends_steps.cache_info().misses
    return [
        "# Triggers in virtual time",
        "",
        "Written by `./run bench virtual`. A line's PLC program, the PLC interface's handshake, the cycle's table, the",
        "deadlines, the judge and the alarms run as they are, on one simulated clock, against simulated devices with",
        "faults at random. Nothing sleeps.",
        "",
        f"- **{total.triggers:,}** triggers in {stories:,} stories of {FRUITS} fruits and three sound ones at the end;",
        f"  {virtual_s / 3600:.1f} hours of the line.",
        f"- {total.triggers / cpu_s * 60:,.0f} triggers per minute of one core's time,",
        f"  {total.triggers / took_s * 60:,.0f} by the clock on the wall ({platform.machine()},",
        f"  {os.cpu_count()} cores, load average {os.getloadavg()[1]:.0f} over 5 minutes: other work ran beside it).",
        "- " + ", ".join(f"{total.decided[name]:,} {name}" for name in DECISIONS) + ".",
        f"- {presses:,} different presses were judged; one that comes again has its judgement from a cache.",
        f"- Seeds {seed} to {seed + stories - 1}.",
        "",
        "## Laws",
        "",
        "Checked at every step of the handshake and of the cycle, at every decision of the PLC, and at a story's end.",
        "",
        "| law | stories that broke it |",
        "|---|---|",
        *(f"| {law} | {broken[law]} |" for law in LAWS),
        "",
        *(f"- `{story}`: {what}" for story, what in failures),
        *([""] if failures else []),
        "## What went wrong, and what the PLC decided meanwhile",
        "",
        "A fruit counts for every trouble that was there while it was in the nest. A camera or gripper that is",
        "`wrong` measures plausible values that are not true: such a press may pass, since nothing shows the error.",
        "",
        "| trouble | " + " | ".join(DECISIONS) + " |",
        "|---|" + "---|" * len(DECISIONS),
        *(
            f"| {name} | " + " | ".join(str(decided[decision]) for decision in DECISIONS) + " |"
            for name, decided in sorted(total.by_trouble.items())
        ),
        "",
        "## What is under test and what is not",
        "",
        "| as it runs on a line | replaces the real one |",
        "|---|---|",
        "| `plc_interface/plc_simulator/program.py` with its mistakes | Modbus: whole blocks are exchanged at once |",
        "| `plc_interface/handshake`: step, timers, journal, view | journal file and channel: memory, with losses |",
        "| `station/inspection/cycle.py`: table, hold | runner and service: a plain interpreter of the actions |",
        "| `station/inspection/deadlines.py` | ticks: it wakes when something is late |",
        "| judge, evidence, early stop, second press, stop criteria | images: areas from a straight line |",
        "| alarm manager, outcome monitor, faults to events and alarms | monitors and housekeeping: polls |",
        "| the records' rules of which outcome is final | SQL, seals and images: a dictionary with the same rules |",
        "",
        "Over the wire `./run bench triggers` and `./run bench faults` test the same, at the pace of a line.",
        "",
        "## What it found",
        "",
        "- A note that the PLC was given an outcome was lost after the PLC had acknowledged it: the handshake had",
        "  forgotten the outcome, the record stayed open, and the station's next start would have made `NO_RESULT`",
        "  of a fruit that had passed. Least story: one mistake of the PLC and one loss on the channel. Every",
        "  outcome now stays in the journal until the station has noted it.",
        "- The alarm of a missed deadline never returned to normal. The next outcome in time now clears it.",
        "- A connection that was cut and made again within one scan of the PLC disarmed the interface, and the PLC's",
        "  program, which had not seen the loss, waited with enable high for ever; so did the function block for real",
        "  PLCs, also after a heartbeat that was missed by a little (story 101). The PLC could not read that it was",
        "  disarmed. Now `enable_inhibited` says it, and every shipped program lets enable fall while it is set.",
        "",
        "## Again",
        "",
        "```",
        "./run bench virtual --triggers 1000000 --seed 1 --minutes 90  # the whole",
        "./run bench virtual --story 17  # one story: its troubles, its end, its least form",
        "```",
    ]


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
    parser.add_argument("--triggers", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--story", type=int, metavar="SEED")
    asked = parser.parse_args()
    logging.disable(logging.CRITICAL)
    if asked.story is not None:
        again(asked.story)
    else:
        run(asked.triggers, asked.seed, asked.minutes)

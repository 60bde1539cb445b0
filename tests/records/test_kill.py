"""A station killed at any moment loses no accepted trigger and gives no number twice."""

import json
import os
import random
import signal
import subprocess
import sys
import threading
from pathlib import Path

from tests.stored_inspection import read_record

WRITER = """
import asyncio, json, os, sys
from pathlib import Path
import numpy as np
from station.records.model import CurvePoint, Image, InspectionRecord, RecipeSnapshot, Trigger
from station.records.records import Records
from station.settings.records import RecordsSettings

def report(*words):
    os.write(1, (json.dumps(words) + "\\n").encode())  # at once, or not at all

async def fruit(records, trigger, record):
    sequence = await records.begin(trigger)
    report("begun", sequence)
    outcome = await records.conclude(sequence, record)
    report("concluded", sequence)
    await records.published(outcome)
    report("published", sequence)

async def main():
    settings = RecordsSettings(deadline_s=30.0, free_reserve_mb=1)
    records = await Records.open(Path(sys.argv[1]), settings, "boot")
    trigger = Trigger(7, 0, "lot", 5, RecipeSnapshot("r", 3, "", "{}"), True)
    pixels = np.random.default_rng().integers(0, 256, (64, 64, 3), dtype=np.uint8)
    record = InspectionRecord("FAIL", ("no_contact",), (), False, False, None, None, None, None, 9, 4,
        curve=tuple(CurvePoint(step, 30.0, None, 1.0, 1, 0.5) for step in range(8)),
        images=(Image("reference", None, pixels), Image("step", 0, pixels // 2)))
    while True:
        await asyncio.gather(*(fruit(records, trigger, record) for _ in range(3)))

for go in sys.stdin:  # what is imported once serves all rounds
    station = os.fork()
    if station == 0:
        report("started", os.getpid())
        asyncio.run(main())
    os.waitpid(station, 0)
    report("ended", station)
"""
ROUNDS = 6


def test_a_killed_station_keeps_every_begun_inspection(opened, scenario, folder, trigger):
    reported: dict[str, list[int]] = {"begun": [], "concluded": [], "published": []}
    with subprocess.Popen([sys.executable, "-c", WRITER, folder], stdin=-1, stdout=-1, text=True) as nursery:
        for _ in range(ROUNDS):
            for word, sequence in _written_until_killed(nursery, after_lines=random.randint(1, 30)):
                reported[word].append(sequence)
    assert len(reported["begun"]) == len(set(reported["begun"])), "no number twice"

    async def steps():
        async with opened() as records:
            was_open = await records.open_inspections()
            assert was_open.running == ()
            ended = {outcome.sequence: outcome for outcome in was_open.ended}
            assert set(reported["begun"]) <= set(ended), "every started inspection is found"
            for sequence in reported["published"]:
                assert ended[sequence].reasons == ("no_contact",), "the outcome that the PLC received remains"
            for sequence in set(reported["concluded"]) - set(reported["published"]):
                full = read_record(records, sequence)
                assert full.judged is not None, "what was concluded is stored"
                assert len(full.judged.curve) == 8
            for sequence in ended:
                for image in read_record(records, sequence).images:
                    assert (folder / "images" / image.sha256[:2] / f"{image.sha256}.png").exists()
            assert await records.begin(trigger) > max(ended)

    scenario(steps)


def _written_until_killed(nursery, after_lines):
    """Return the lines that one station printed until it was killed, at a random moment after so many lines."""
    nursery.stdin.write("go\n")
    nursery.stdin.flush()
    lines = []
    station, killer = 0, None
    for line in nursery.stdout:
        word, number = json.loads(line)
        if word == "started":
            station = number
        elif word == "ended":
            assert len(lines) >= after_lines, "it was killed, and did not end by itself"
            break
        else:
            lines.append((word, number))
        if len(lines) == after_lines:
            killer = threading.Timer(random.uniform(0, 0.02), os.kill, (station, signal.SIGKILL))
            killer.start()
    assert killer is not None, "it wrote too few lines"
    killer.join()
    return lines


def test_a_station_killed_at_random_moments_keeps_all_that_it_acknowledged():
    """A sample of `./run bench kills`: the outbox, the audit trail and the images too."""
    program = Path(__file__).resolve().parents[2] / "benchmarks" / "bench_kills.py"
    done = subprocess.run(
        [sys.executable, program, "--rounds", "8", "--json"], capture_output=True, text=True, timeout=110, check=False
    )
    assert done.stdout, done.stderr[-2000:]
    report = json.loads(done.stdout)
    assert report["told"]["begun"] > 0
    assert {what: number for what, number in report["wrong"].items() if number} == {}
    assert len(report["wrong"]) == 12

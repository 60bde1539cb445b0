"""Eight hours in one: the whole station at its full pace, and what grows in its processes meanwhile.

Run with `./run bench soak [--minutes 80]`: the twin, the station's processes, the line, three panels and two readers,
PostgreSQL and an MQTT broker, with the images at their quota. Every ten seconds each process's memory, descriptors and
threads are read, the PLC's latency, the cycle's time, the records' space and what waits in the outbox; and, for what
the machine does meanwhile, the latency of the same server with no station behind it, and the time of a fixed piece of
work. Ctrl-C ends it; what was sampled until then is written. Writes `docs/soak.md` and `docs/images/soak.svg`.
"""

import argparse
import asyncio
import contextlib
import hashlib
import os
import signal
import statistics
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import psutil
from bench_plc import HOST, SCAN_US, built
from soak.cell import EARLIER, Cell, running
from soak.document import CHART, Ending, draw, page
from soak.samples import Latency, Sample, counts, processes, scrape, size_mb

from station.errors import StationError
from station.records.database import FILE_NAME, records_folder

DOCUMENT = Path(__file__).resolve().parents[1] / "docs" / "soak.md"
MINUTES = 80.0
WINDOW_S = 10.0
_WORK, _WORK_EVERY_S = bytes(1 << 20), 0.2
"""What is hashed as the fixed piece of work, some milliseconds' worth, and how often."""
_ARRIVAL_S = 60.0
"""Until PostgreSQL has everything, once the line has ended."""


@dataclass(slots=True)
class Run:
    """Results of a run so far; they are written at any end of the run."""

    samples: list[Sample] = field(default_factory=list)
    """One for each window."""
    ending: Ending = field(default_factory=lambda: Ending({}, None))


async def latency(load: Path, port: int, ended: asyncio.Event) -> Latency | None:
    """Measure a server's response times at one read each scan, for one window; None where the soak ends in it.

    Args:
        load: the client program.
        port: of the PLC interface, or of the bare server.
        ended: set where the soak is to end.
    """
    arguments = (HOST, str(port), "1", str(WINDOW_S), str(SCAN_US))
    process = await asyncio.create_subprocess_exec(
        load, *arguments, stdout=asyncio.subprocess.PIPE, start_new_session=True
    )
    measuring, ending = asyncio.create_task(process.communicate()), asyncio.create_task(ended.wait())
    try:
        await asyncio.wait([measuring, ending], return_when=asyncio.FIRST_COMPLETED)
        printed = measuring.result()[0] if measuring.done() else b""
        return Latency(*map(float, printed.split()[1:])) if printed else None
    finally:
        ending.cancel()
        with contextlib.suppress(ProcessLookupError):
            process.kill()
        await asyncio.gather(measuring, ending, return_exceptions=True)


async def work_ms(ended: asyncio.Event) -> float:
    """Return the mean time of a fixed piece of work, done again and again for one window.

    Args:
        ended: set where the soak is to end.
    """
    took_s, until_s = list[float](), time.monotonic() + WINDOW_S
    while not took_s or (time.monotonic() < until_s and not ended.is_set()):
        took_s.append(await asyncio.to_thread(_hashed))
        await asyncio.sleep(_WORK_EVERY_S)
    return 1000 * statistics.fmean(took_s)


def _hashed() -> float:
    began_s = time.perf_counter()
    hashlib.sha256(_WORK)
    return time.perf_counter() - began_s


async def soak(minutes: float, run: Run) -> None:
    """Run the cell and sample it.

    Args:
        minutes: for so long, from the first fruit.
        run: gets everything.

    Raises:
        StationError: a process does not start, or the line ended.
        SystemExit: a program is missing, or the pages do not answer.
    """
    ended = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        asyncio.get_running_loop().add_signal_handler(number, ended.set)
    with tempfile.TemporaryDirectory() as folder:
        load = built("load", Path(folder))
        async with running() as cell:
            began_s = time.monotonic()
            while time.monotonic() - began_s < 60 * minutes and not ended.is_set():
                if cell.running.done():
                    await cell.running
                figures, bare, work = await asyncio.gather(
                    latency(load, cell.site.modbus.port, ended), latency(load, cell.bare_port, ended), work_ms(ended)
                )
                if figures is not None and bare is not None:
                    at_s = time.monotonic() - began_s
                    run.samples.append(await asyncio.to_thread(sampled, cell, (figures, bare), work, at_s))
                    print(progress(run.samples[-1]), file=sys.stderr)
            cell.running.cancel()
            await asyncio.gather(cell.running, return_exceptions=True)
            decided = {str(how): number for how, number in cell.line.summary.decided.items() if number}
            run.ending = Ending(decided, None if ended.is_set() else await unsent(cell))


def sampled(cell: Cell, latencies: tuple[Latency, Latency], work: float, at_s: float) -> Sample:
    """Read everything once.

    Args:
        cell: what runs.
        latencies: the PLC's in the window that ends now, and the bare server's.
        work: mean time of the fixed piece of work in that window, ms.
        at_s: since the first fruit.
    """
    metrics, records = cell.site.metrics, records_folder(cell.site.home)
    text = scrape(f"http://{metrics.host}:{metrics.port}/metrics")
    found = processes(psutil.Process().children(recursive=True))
    images_mb, database_mb = size_mb(records, "images/**/*.png"), size_mb(records, f"{FILE_NAME}*")
    return Sample(at_s, found, *latencies, work, counts(text), images_mb, database_mb)


async def unsent(cell: Cell) -> int:
    """Count the decided inspections, with those from before, that PostgreSQL does not have after some time for them.

    Args:
        cell: the soak, after its line has ended.
    """
    answered = sum(number for how, number in cell.line.summary.decided.items() if how in {"PASS", "FAIL", "NO_RESULT"})
    until_s, missing = time.monotonic() + _ARRIVAL_S, answered
    while missing > 0 and time.monotonic() < until_s:
        await asyncio.sleep(0.5)
        with cell.server.connect() as connection:
            found = connection.execute("SELECT count(DISTINCT sequence) FROM inspections").fetchone()
        missing = EARLIER + answered - (found[0] if found else 0)
    return max(0, missing)


def progress(sample: Sample) -> str:
    """One line for who waits."""
    memory = ", ".join(f"{name} {each.unique_mb:.1f} MB" for name, each in sample.processes.items())
    return (
        f"{sample.at_s:5.0f} s: {sample.counts.fruit:.0f} fruit; {memory}; PLC {sample.latency.p99_us:.0f} µs; images "
        f"{sample.images_mb:.0f} MB; outbox {sample.counts.waiting:.0f} waiting"
    )


def main() -> int:
    """Run, and write what was sampled."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=MINUTES, help="from the first fruit on")
    options = parser.parse_args()
    run, trouble = Run(), ""
    try:
        asyncio.run(soak(options.minutes, run))
    except (StationError, OSError, SystemExit) as error:
        trouble = str(error)
        print(trouble, file=sys.stderr)
    if run.samples:
        text = page(run.samples, run.ending, options.minutes, trouble, os.getloadavg()[2])
        print(text)
        DOCUMENT.write_text(text, encoding="utf-8")
        draw(run.samples, CHART)
    return 1 if trouble or not run.samples else 0


if __name__ == "__main__":
    raise SystemExit(main())

"""`station study`: the paper's experiments, repeated on the twin."""

import os
import sys
from pathlib import Path

import click

from station.studies.cohort import FRUITS
from station.studies.study import LARGEST_COHORT, Request, run_study
from station.studies.workers import stop_on_sigterm


@click.command("study")
@click.option("--fruit", required=True, type=click.Choice(FRUITS), help="What is pressed.")
@click.option("--samples", required=True, type=click.IntRange(1, LARGEST_COHORT), help="Size of the cohort.")
@click.option(
    "--seed", default=0, show_default=True, type=click.IntRange(0, 2**31 - 1), help="Another, another cohort."
)
@click.option("--method", required=True, type=click.Choice(["paper", "robust"]), help="Method of the measurement.")
@click.option("--out", required=True, type=click.Path(path_type=Path), help="Folder of the study; its own is resumed.")
@click.option(
    "--jobs",
    type=click.IntRange(1, 256),
    default=lambda: os.cpu_count() or 1,
    show_default="one a core",
    help="Samples measured at the same time.",
)
@click.option("--scheduler", metavar="ADDRESS", help="Measure on the Dask cluster whose scheduler is there.")
def study(fruit: str, samples: int, seed: int, method: str, out: Path, jobs: int, scheduler: str | None) -> None:
    """Press a cohort of the paper's fruit on the twin, and count the samples whose measurement fails.

    Writes samples/, curves.csv, summary.json and report.html. Interrupted, it continues when the same
    command is given again; with more --samples the cohort grows. The same seed gives the same numbers on any machine
    of the same kind, with any number of workers. No device is touched.
    """
    stop_on_sigterm()
    request = Request(fruit, samples, seed, method, out, jobs, scheduler)
    with click.progressbar(length=samples, label="pressing", file=sys.stderr, hidden=not sys.stderr.isatty()) as bar:

        def begin(stored: int) -> None:
            bar.update(stored)
            click.echo(
                f"station: {stored} of {samples} samples are stored, {samples - stored} to be measured", err=True
            )

        try:
            done = run_study(request, begin, lambda: bar.update(1))
        except KeyboardInterrupt:
            click.echo(f"\nstation: {out} keeps what was measured; the same command goes on from there", err=True)
            raise
    from station.studies.report import write_report  # noqa: PLC0415 (its plotting takes seconds to load)

    write_report(done)
    click.echo(
        f"{fruit}, {method}: {done.failed} of {samples} samples failed ({done.failed / samples:.1%}); "
        f"report: {out / 'report.html'}"
    )

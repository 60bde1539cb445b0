"""`station grr`: repeatability and reproducibility of the measurement."""

import os
import sys
from pathlib import Path

import click

from station.studies.gauge_design import TwinDesign, study_on_twin
from station.studies.gauge_report import aiag_class, render
from station.studies.gauge_table import read_measurements
from station.studies.grr import GaugeStudy, analysed, check_folder, store
from station.studies.workers import stop_on_sigterm

_FRUITS = ("strawberry", "blueberry", "raspberry")


@click.command("grr")
@click.argument("measurements", required=False, type=click.Path(path_type=Path), metavar="[CSV]")
@click.option("--twin", is_flag=True, help="Measure simulated fruit, half of them bruised, in place of a CSV file.")
@click.option("--fruit", default="strawberry", show_default=True, type=click.Choice(_FRUITS), help="With --twin.")
@click.option("--dummies", is_flag=True, help="With --twin: firm balls in a jig in place of fruit, the gauge alone.")
@click.option("--parts", default=10, show_default=True, type=click.IntRange(2, 100), help="With --twin.")
@click.option("--operators", default=3, show_default=True, type=click.IntRange(2, 26), help="With --twin.")
@click.option("--repeats", default=3, show_default=True, type=click.IntRange(2, 20), help="With --twin.")
@click.option("--seed", default=0, show_default=True, type=click.IntRange(0, 2**31 - 1), help="With --twin.")
@click.option(
    "--jobs",
    type=click.IntRange(1, 256),
    default=lambda: os.cpu_count() or 1,
    show_default="one a core",
    help="With --twin: measurements made at the same time.",
)
@click.option(
    "--tolerance",
    type=click.FloatRange(0, 1e6, min_open=True),
    metavar="MM2",
    help="Difference of area between good and damaged fruit; with --twin its own by default.",
)
@click.option("--out", required=True, type=click.Path(path_type=Path), help="Folder for the results; must not exist.")
def grr(
    measurements: Path | None,
    twin: bool,  # noqa: FBT001 (click passes arguments by name)
    fruit: str,
    dummies: bool,  # noqa: FBT001
    parts: int,
    operators: int,
    repeats: int,
    seed: int,
    jobs: int,
    tolerance: float | None,
    out: Path,
) -> None:
    """Analyse a gauge study: every operator measured every part several times.

    The CSV file has the columns part,operator,repeat,area_mm2 and, where known, outcome (PASS, FAIL, NO_RESULT) and
    reference (PASS, FAIL). Writes measurements.csv, grr.json and report.html; interrupted, it writes nothing.
    """
    if twin == (measurements is not None):
        raise click.UsageError("expected either a CSV file of measurements or --twin")
    if dummies and not twin:
        raise click.UsageError("--dummies goes with --twin; of real ones give the CSV file alone")
    stop_on_sigterm()
    check_folder(out)
    if measurements is not None:
        facts = [("Measurements", str(measurements))]
        if tolerance is not None:
            facts.append(("Tolerance", f"{tolerance:g} mm²"))
        study = analysed(str(measurements), facts, read_measurements(measurements), tolerance)
    else:
        study = _on_twin(TwinDesign(fruit, parts, operators, repeats, seed, jobs, dummies), tolerance)
    store(study, render(study), out)
    click.echo(f"{aiag_class(study.gauge)[1]} Report: {out / 'report.html'}")


def _on_twin(design: TwinDesign, tolerance: float | None) -> GaugeStudy:
    with click.progressbar(
        length=len(design.tasks), label="gripping", file=sys.stderr, hidden=not sys.stderr.isatty()
    ) as bar:
        return study_on_twin(design, tolerance, lambda: bar.update(1))

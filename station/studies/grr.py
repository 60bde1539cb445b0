"""Gauge study of `station grr`: measurements, analysed, and the folder of results."""

import contextlib
import errno
import json
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import NamedTuple

from station.atomic_file import write_atomically
from station.errors import BadInputError, StationError
from station.studies.agreement import Agreement, agreement
from station.studies.gauge import Gauge, analyse
from station.studies.gauge_table import Crossed, Measurement, crossed, written


class Origin(NamedTuple):
    """The same study with a part of the causes of variation."""

    name: str
    gauge: Gauge


@dataclass(frozen=True, slots=True)
class GaugeStudy:
    """A gauge study as analysed."""

    title: str
    facts: Sequence[tuple[str, str]]
    measurements: Sequence[Measurement]
    table: Crossed
    gauge: Gauge
    agreement: Agreement | None
    """None if outcomes were not recorded."""
    origins: Sequence[Origin] = ()
    """Origin of the variation: true areas with more and more causes, and last the measured ones; empty if no truth is
    known."""


def analysed(
    title: str, facts: Sequence[tuple[str, str]], measurements: Sequence[Measurement], tolerance: float | None
) -> GaugeStudy:
    """Analyse areas and outcomes, with a tolerance in mm² or none; messages name the source by the title.

    Raises:
        BadInputError: the measurements do not make a complete table.
    """
    table = crossed(measurements, title)
    gauge = analyse(table.areas_mm2, tolerance)
    agreed = None if table.passed is None else agreement(table.passed, table.operators, table.good)
    return GaugeStudy(title, facts, measurements, table, gauge, agreed)


def check_folder(out: Path) -> None:
    """Check before the work that the results can be stored in a folder.

    Raises:
        BadInputError: it is not empty, or it cannot be made.
    """
    try:
        if out.exists() and (not out.is_dir() or any(out.iterdir())):
            raise BadInputError(f"{out}: is there already and not empty; name a new folder with --out")
        out.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=out.parent):
            pass
    except OSError as error:
        raise BadInputError(f"{out}: cannot be written: {error.strerror}; name another folder with --out") from error


def store(study: GaugeStudy, page: str, out: Path) -> None:
    """Write `measurements.csv`, `grr.json` and `report.html`, all or none, into an empty or missing folder.

    Raises:
        StationError: the disk is full or the folder cannot be written; no file is left.
    """
    files = {
        "measurements.csv": written(study.measurements),
        "grr.json": (json.dumps(summary(study), indent=2) + "\n").encode(),
        "report.html": page.encode(),
    }
    # Beside the folder: only within one file system a folder is renamed as a whole.
    unfinished = Path(tempfile.mkdtemp(prefix=f".{out.name}.", dir=out.parent))
    try:
        for name, data in files.items():
            write_atomically(unfinished / name, data)
        # A folder of `mkdtemp` is readable for its user only.
        unfinished.chmod(0o755)
        with contextlib.suppress(FileNotFoundError):
            out.rmdir()
        unfinished.rename(out)
    except OSError as error:
        shutil.rmtree(unfinished, ignore_errors=True)
        remedy = "free space" if error.errno in {errno.ENOSPC, errno.EDQUOT} else "name another folder with --out"
        raise StationError(f"{out}: cannot be written: {error.strerror}; nothing is stored: {remedy}") from error
    except BaseException:
        shutil.rmtree(unfinished, ignore_errors=True)
        raise


def summary(study: GaugeStudy) -> dict[str, object]:
    """Return the content of `grr.json`."""
    gauge = study.gauge
    return {
        "parts": len(study.table.parts),
        "operators": len(study.table.operators),
        "repeats": study.table.areas_mm2.shape[2],
        "tolerance_mm2": gauge.tolerance,
        "distinct_categories": gauge.distinct_categories,
        "interaction_pooled": gauge.pooled,
        "components": _components(gauge),
        "origins": [{"name": one.name, "components": _components(one.gauge)} for one in study.origins],
        "agreement": None if study.agreement is None else asdict(study.agreement),
    }


def _components(gauge: Gauge) -> dict[str, dict[str, float | None]]:
    return {
        one.name: {
            "sigma_mm2": one.sigma,
            "study_percent": one.study_percent,
            "contribution_percent": one.contribution_percent,
            "tolerance_percent": one.tolerance_percent,
        }
        for one in gauge.components
    }

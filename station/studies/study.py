"""Study run of `station study`: a cohort pressed on the twin and measured, resumed after an interruption."""

import csv
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from io import StringIO
from itertools import pairwise
from pathlib import Path

import numpy as np

from station.binomial import clopper_pearson
from station.studies.cohort import RESULT_CLOSINGS_MM
from station.studies.failure import Cause, failures, image_at
from station.studies.folder import StudyFolder, identity_of
from station.studies.sample import SampleResult, Task, measure_sample
from station.studies.workers import on_cluster, on_this_machine
from station.twin.fruit import Kind
from station.twin.gel import MM_PER_PX

LARGEST_COHORT = 10_000


@dataclass(frozen=True, slots=True)
class Request:
    """Cohort, method and result folder of a study."""

    fruit: str
    samples: int
    seed: int
    method: str
    out: Path
    jobs: int
    scheduler: str | None = None
    """Address of a Dask cluster in place of this machine's cores."""

    @property
    def kind(self) -> Kind:
        """Return the twin's kind of the fruit."""
        return Kind(self.fruit)


@dataclass(frozen=True, slots=True)
class Study:
    """A measured cohort."""

    request: Request
    samples: tuple[SampleResult, ...]
    causes: tuple[frozenset[Cause], ...]
    """Causes of each sample's failure, by the study's definition; empty if it did not fail."""
    later_causes: tuple[frozenset[Cause], ...]
    """The same, only from the first result's closing on."""

    @property
    def result_closings_mm(self) -> tuple[float, ...]:
        """Return the closings of the results."""
        return RESULT_CLOSINGS_MM[self.request.kind]

    @property
    def failed(self) -> int:
        """Return the number of failed samples."""
        return sum(map(bool, self.causes))


def run_study(request: Request, on_begin: Callable[[int], None], on_done: Callable[[], None]) -> Study:
    """Measure the samples that are not stored yet, and write the summary.

    Args:
        on_begin: called with the number of stored samples.
        on_done: called after each new one.

    Raises:
        BadInputError: the folder is another study's or cannot be written, or the cluster does not answer.
        StationError: a write or a worker failed; the samples measured by then are stored.
    """
    tasks = [Task(request.fruit, request.method, request.seed, number) for number in range(1, request.samples + 1)]
    folder = StudyFolder(request.out, identity_of(tasks[0]))
    results = {task.number: found for task in tasks if (found := folder.stored(task.number)) is not None}
    on_begin(len(results))
    missing = [task for task in tasks if task.number not in results]
    if missing:
        for result in _measured(missing, request):
            folder.store(result)
            results[result.number] = result
            on_done()
    study = judged(request, [results[task.number] for task in tasks])
    folder.write("curves.csv", _curves(study))
    folder.write("summary.json", (json.dumps(summary(study), indent=2) + "\n").encode())
    return study


def _measured(tasks: Sequence[Task], request: Request) -> Iterator[SampleResult]:
    if request.scheduler is not None:
        return on_cluster(tasks, request.scheduler)
    return on_this_machine(measure_sample, tasks, request.jobs)


def judged(request: Request, samples: Sequence[SampleResult]) -> Study:
    """Judge each of all samples, in order."""
    closings = RESULT_CLOSINGS_MM[request.kind]

    def causes(sample: SampleResult, from_mm: float | None) -> frozenset[Cause]:
        return failures(sample.closings_mm, sample.areas_px, sample.true_areas_px, closings, from_mm=from_mm)

    return Study(
        request,
        tuple(samples),
        tuple(causes(sample, None) for sample in samples),
        tuple(causes(sample, closings[0]) for sample in samples),
    )


def summary(study: Study) -> dict[str, object]:
    """Return the content of `summary.json`; the same for the same cohort, method and program."""
    request, samples = study.request, study.samples
    number = len(samples)
    low, high = clopper_pearson(study.failed, number)
    later = sum(map(bool, study.later_causes))
    return {
        "fruit": request.fruit,
        "method": request.method,
        "samples": number,
        "failures": study.failed,
        "failure_rate": study.failed / number,
        "failure_rate_95": [low, high],
        "causes": {str(cause): sum(cause in found for found in study.causes) for cause in Cause},
        "seed": request.seed,
        "failures_from_first_result": later,
        "failure_rate_from_first_result": later / number,
        "false_contacts": sum(map(found_before_touch, samples)),
        "results": [_result(study, place) for place in range(len(study.result_closings_mm))],
        "rising": sum(rising(study, sample) for sample in samples),
        "failed_samples": [sample.number for sample, found in zip(samples, study.causes, strict=True) if found],
    }


def _result(study: Study, place: int) -> dict[str, float]:
    """Return the ratio of areas to the truth in the images at one of the results' closings."""
    images = [image_at(sample.closings_mm, study.result_closings_mm)[place] for sample in study.samples]
    areas = np.array([sample.areas_px[at] for sample, at in zip(study.samples, images, strict=True)])
    truth = np.array([sample.true_areas_px[at] for sample, at in zip(study.samples, images, strict=True)])
    # An image without a true contact must not divide by 0.
    ratio = areas / np.maximum(truth, 1)
    return {
        "closing_mm": study.result_closings_mm[place],
        "mean_area_mm2": float(areas.mean() * MM_PER_PX**2),
        "sd_area_mm2": float(areas.std(ddof=1) * MM_PER_PX**2) if areas.size > 1 else 0.0,
        "mean_true_area_mm2": float(truth.mean() * MM_PER_PX**2),
        "median_area_over_truth": float(np.median(ratio)),
        "p10_area_over_truth": float(np.percentile(ratio, 10)),
        "p90_area_over_truth": float(np.percentile(ratio, 90)),
    }


def found_before_touch(sample: SampleResult) -> bool:
    """Check whether an area was found in an image without contact."""
    return any(area > 0 and closing <= 0 for area, closing in zip(sample.areas_px, sample.closings_mm, strict=True))


def rising(study: Study, sample: SampleResult) -> bool:
    """Check whether the area rises strictly from the image at one result's closing to the next."""
    areas = [sample.areas_px[at] for at in image_at(sample.closings_mm, study.result_closings_mm)]
    return all(after > before for before, after in pairwise(areas))


def _curves(study: Study) -> bytes:
    text = StringIO(newline="")
    table = csv.writer(text)
    text.write("sample,closing_mm,area_px,true_area_px,area_mm2,true_area_mm2,confidence,flags,failed\r\n")
    for sample, causes in zip(study.samples, study.causes, strict=True):
        for closing_mm, area, true_area, confidence, flags in zip(
            sample.closings_mm, sample.areas_px, sample.true_areas_px, sample.confidences, sample.flags, strict=True
        ):
            table.writerow(
                (
                    sample.number,
                    f"{closing_mm:.3f}",
                    area,
                    true_area,
                    f"{area * MM_PER_PX**2:.3f}",
                    f"{true_area * MM_PER_PX**2:.3f}",
                    "" if confidence is None else f"{confidence:.3f}",
                    ";".join(flags),
                    ";".join(sorted(causes)),
                )
            )
    return text.getvalue().encode()

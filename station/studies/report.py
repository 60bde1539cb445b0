"""Study report: one HTML file with its figures inside."""

from importlib.metadata import version

from station.binomial import clopper_pearson
from station.charts.report import data_uri, templates
from station.studies import figures
from station.studies.cohort import PAPER_FAILURES, PAPER_SAMPLES
from station.studies.failure import DEFINITION, Cause, image_at
from station.studies.folder import StudyFolder, identity_of
from station.studies.sample import Task, segmentation_of
from station.studies.study import Study, summary
from station.twin.gel import MM_PER_PX


def share(count: int, of: int) -> str:
    """Describe the share of cases in trials with its 95 % interval."""
    low, high = clopper_pearson(count, of)
    return f"{count / of:.1%} ({low:.1%} to {high:.1%})"


def write_report(study: Study) -> None:
    """Write `report.html` into the study's folder.

    Raises:
        BadInputError: the folder is no longer the study's.
        StationError: the disk is full or the folder has become unwritable.
    """
    request = study.request
    identity = identity_of(Task(request.fruit, request.method, request.seed, 1))
    page = (
        templates("station.studies")
        .get_template("study.html.j2")
        .render(
            title=f"{request.fruit.replace('_', ' ').capitalize()}, {request.method}: {len(study.samples)} samples",
            facts=_facts(study),
            definition=DEFINITION,
            failures=_failures(study),
            summary=summary(study),
            figures=_figures(study),
            samples=_samples(study),
            closings=study.result_closings_mm,
        )
    )
    StudyFolder(request.out, identity).write("report.html", page.encode())


def _facts(study: Study) -> list[tuple[str, str]]:
    request = study.request
    segmentation = segmentation_of(request.fruit, request.method)
    parameters = segmentation.paper if request.method == "paper" else segmentation.robust
    closings = study.samples[0].closings_mm
    return [
        ("Cohort", f"{request.fruit}, seed {request.seed}; sizes as listed in the paper, all else drawn"),
        ("Images", f"{len(closings)} a sample, 1 mm apart, on the twin"),
        ("Method", request.method),
        ("Parameters", ", ".join(f"{name} {value}" for name, value in parameters.model_dump().items())),
        ("Program", f"fruit-station {version('fruit-station')}"),
        ("The paper", "Computers and Electronics in Agriculture 235 (2025) 110397"),
    ]


def _failures(study: Study) -> list[tuple[str, str, str]]:
    """Return rows of name, value here, value in the paper."""
    number = len(study.samples)
    paper = PAPER_FAILURES.get(study.request.kind)
    later = sum(map(bool, study.later_causes))
    words_of = {
        Cause.NO_CONTACT: "no contact found",
        Cause.FALLING_AREA: "area falls by more than 10 %",
        Cause.WRONG_AREA: "area wrong by more than 50 %",
    }
    return [
        ("failed", share(study.failed, number), "not reported" if paper is None else share(paper, PAPER_SAMPLES)),
        *(
            (f"… {words}", share(sum(cause in c for c in study.causes), number), "")
            for cause, words in words_of.items()
        ),
        (
            f"failed, looking only from {study.result_closings_mm[0]:g} mm of closing on",
            share(later, number),
            "",
        ),
    ]


def _figures(study: Study) -> list[tuple[str, str]]:
    """Return captions and data URIs."""
    found: list[tuple[str, bytes]] = [
        ("Area over closing of every sample; dotted: the results' closings.", figures.cohort_curves([study])),
        (
            "Measured over true area at the results' closings. Grey: within 50 %; crosses: samples that failed.",
            figures.areas_at_results([study]),
        ),
    ]
    for failed, words in ((False, "did not fail"), (True, "failed")):
        sample = figures.typical(study, failed=failed)
        if sample is None:
            continue
        name = f"Sample {sample.number}, {sample.width_mm:.1f} mm wide, the middle one of those that {words}"
        found += [
            (f"{name}: area over closing.", figures.one_curve([study], sample.number)),
            (f"{name}: its images. Red: the true edge.", figures.press_sheet(study, sample.number)),
        ]
    return [(caption, data_uri(picture)) for caption, picture in found]


def _samples(study: Study) -> list[dict[str, object]]:
    rows: list[dict[str, object]] = []
    for sample, causes in zip(study.samples, study.causes, strict=True):
        places = image_at(sample.closings_mm, study.result_closings_mm)
        rows.append(
            {
                "number": sample.number,
                "weight_g": sample.weight_g,
                "length_mm": sample.length_mm,
                "width_mm": sample.width_mm,
                "areas": [
                    (sample.areas_px[at] * MM_PER_PX**2, sample.true_areas_px[at] * MM_PER_PX**2) for at in places
                ],
                "causes": ", ".join(sorted(cause.replace("_", " ") for cause in causes)),
            }
        )
    return rows

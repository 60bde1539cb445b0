"""The paper's experiments with both methods on the twin, its denoising on real presses, and the gauge study.

Run with `./run bench study`, with the folder of real images beside the checkout or named by `--images`. Cohorts are
stored below `state/study` and resumed; those that another version of the code measured are measured anew. Writes the
tables of `docs/paper.md` and `docs/grr.md` and the pictures below `docs/paper`. `--only robust` measures no more,
`--only gauge` writes `docs/grr.md` alone.
"""

import argparse
import csv
import os
import re
import shutil
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np

from station.binomial import clopper_pearson
from station.settings.segmentation import PaperParameters
from station.studies import figures
from station.studies.cohort import PAPER_FAILURES, PAPER_SAMPLES, member
from station.studies.folder import Identity, identity_of
from station.studies.gauge_design import TwinDesign, study_on_twin
from station.studies.gauge_figures import components_plot, measurements_plot
from station.studies.gauge_report import aiag_class, tolerance_percents
from station.studies.grr import GaugeStudy
from station.studies.sample import Task
from station.studies.study import Request, Study, judged, run_study, summary
from station.twin.fruit import Kind
from station.vision.contact import Image
from station.vision.median import median_image
from station.vision.paper import amplified_difference, denoise
from station.vision.quality import denoising_quality

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
COHORTS = ROOT / "state" / "study"
SEED = 2025
FRUITS = (Kind.STRAWBERRY, Kind.BLUEBERRY, Kind.RASPBERRY)
BALL_REPEATS = 14


def cohort(kind: Kind, method: str, samples: int) -> Study:
    """Measure a cohort, or read what is stored of it."""
    out = COHORTS / f"{kind}-{method}"
    label = out / "study.json"
    if label.exists():
        stored = Identity.model_validate_json(label.read_bytes())
        if stored != identity_of(Task(str(kind), method, SEED, 0)):
            shutil.rmtree(out)
    began, done = time.monotonic(), 0

    def on_done() -> None:
        nonlocal done
        done += 1
        print(f"\r{kind} {method}: {done} in {time.monotonic() - began:.0f} s", end="", file=sys.stderr, flush=True)

    request = Request(str(kind), samples, SEED, method, out, os.cpu_count() or 1)
    study = run_study(request, lambda there: print(f"{kind} {method}: {there} stored", file=sys.stderr), on_done)
    print(file=sys.stderr)
    return study


def first(study: Study, number: int) -> Study:
    """The beginning of a cohort."""
    return judged(study.request, study.samples[:number])


def percent(count: int, of: int) -> str:
    """A share with its interval."""
    low, high = clopper_pearson(count, of)
    return f"{count} of {of}: {count / of:.1%} ({low:.1%} to {high:.1%})"


def table(header: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A table in Markdown."""
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return "\n".join([*lines, *("| " + " | ".join(map(str, row)) + " |" for row in rows)])


def failure_table(studies: dict[tuple[Kind, str], Study]) -> str:
    """Failures of both methods beside the paper's."""
    rows = []
    for kind in FRUITS:
        paper, robust = studies[kind, "paper"], studies[kind, "robust"]
        rows.append(
            [
                kind,
                percent(PAPER_FAILURES[kind], PAPER_SAMPLES),
                percent(paper.failed, len(paper.samples)),
                percent(first(robust, len(paper.samples)).failed, len(paper.samples)),
                percent(robust.failed, len(robust.samples)),
            ]
        )
    return table(
        ["", "the paper", "`paper` on the twin", "`robust`, the same samples", "`robust`, whole cohort"],
        rows,
    )


def cause_table(studies: dict[tuple[Kind, str], Study]) -> str:
    """Return a table of the causes of failed samples, by fruit and method."""
    rows = []
    for (kind, method), study in studies.items():
        if kind == Kind.RUBBER_BALL:
            continue
        totals = summary(study)
        causes = totals["causes"]
        assert isinstance(causes, dict)
        rows.append(
            [kind, f"`{method}`", len(study.samples), study.failed, *causes.values(),
             totals["failures_from_first_result"], totals["false_contacts"]]
        )  # fmt: skip
    return table(
        [
            "", "method", "samples", "failed", "no contact", "area falls", "area wrong", "failed from first result on",
            "area before the touch",
        ],
        rows,
    )  # fmt: skip


def result_table(studies: dict[tuple[Kind, str], Study]) -> str:
    """Areas at the results' closings."""
    rows = []
    for kind in FRUITS:
        by_method = {m: summary(first(studies[kind, m], PAPER_SAMPLES))["results"] for m in ("paper", "robust")}
        for ours, theirs in zip(by_method["robust"], by_method["paper"], strict=True):  # pyrefly: ignore[bad-argument-type] (lists, by their name)
            rows.append(
                [
                    kind,
                    f"{ours['closing_mm']:g}",
                    f"{ours['mean_true_area_mm2']:.0f}",
                    *(f"{one['mean_area_mm2']:.0f} ± {one['sd_area_mm2']:.0f}" for one in (theirs, ours)),
                    *(
                        f"{one['median_area_over_truth']:.2f} ({one['p10_area_over_truth']:.2f} to "
                        f"{one['p90_area_over_truth']:.2f})"
                        for one in (theirs, ours)
                    ),
                ]
            )
    return table(
        [
            "", "closing, mm", "truth, mm²", "`paper`, mm²", "`robust`, mm²", "`paper` over truth: median (p10 to p90)",
            "`robust` over truth",
        ],
        rows,
    )  # fmt: skip


def size_table(studies: dict[tuple[Kind, str], Study]) -> str:
    """The cohorts' sizes, which are the paper's, and what comes of them."""
    rows = []
    for kind in FRUITS:
        samples = first(studies[kind, "robust"], PAPER_SAMPLES).samples
        sizes = np.array([(s.weight_g, s.length_mm, s.width_mm) for s in samples])
        rows.append([kind, *(f"{m:.2f} ± {d:.2f}" for m, d in zip(sizes.mean(0), sizes.std(0, ddof=1), strict=True))])
    return table(["", "weight, g", "length, mm", "width, mm"], rows)


def ball_table(studies: dict[tuple[Kind, str], Study]) -> str:
    """The ball's areas over its widths."""
    paper, robust = (studies[Kind.RUBBER_BALL, method] for method in ("paper", "robust"))
    rows = []
    for place, closing_mm in enumerate(paper.samples[0].closings_mm):
        if not 0 <= closing_mm <= 7:
            continue
        areas = [np.array([s.areas_px[place] for s in study.samples]) for study in (paper, robust)]
        truth = np.mean([s.true_areas_px[place] for s in paper.samples])
        rows.append([f"{42 - closing_mm:g}", f"{truth:.0f}", *(f"{a.mean():.0f} ± {a.std(ddof=1):.0f}" for a in areas)])
    rising = ", ".join(
        f"`{study.request.method}` {summary(study)['rising']} of {len(study.samples)}" for study in (paper, robust)
    )
    return (
        table(["width, mm", "truth, px", "`paper`, px", "`robust`, px"], rows)
        + f"\n\nPresses in which the area rises at every step from 41 to 35 mm: {rising}."
    )


def denoising_table(images: Path) -> str:
    """The paper's Table 2 on the twin's ball, and on real presses where they are."""
    sets: dict[str, list[tuple[Image, Image]]] = {}
    folder = images / "digit_presses"
    if folder.is_dir():
        reference = read(folder / "reference.jpg")
        sets["30 real presses of a 6 mm ball"] = [
            (reference, read(path)) for path in sorted(folder.glob("*.jpg")) if path.name != "reference.jpg"
        ]
    press = member(Kind.RUBBER_BALL, SEED, 0).press()
    reference = median_image(press.references)
    sets["the twin's 24 mm ball, 46 to 33 mm"] = [(reference, frame) for frame in press.frames]
    parameters = PaperParameters()
    rows = [["the paper", "26.422", "148.197", "0.550", ""]]
    for name, pairs in sets.items():
        found = []
        for before, after in pairs:
            difference = amplified_difference(after, before, parameters.amplification)
            quality = denoising_quality(difference, denoise(difference, parameters))
            found.append((quality.psnr_db, quality.mse, quality.ssim))
        psnr_db, mse, ssim = np.mean(found, axis=0)
        rows.append(
            [
                name,
                f"{psnr_db:.3f}",
                f"{mse:.3f}",
                f"{ssim:.3f}",
                f"{min(found)[0]:.1f} to {max(found)[0]:.1f} dB",
            ]
        )
    return table(["", "PSNR, dB", "MSE", "SSIM", "PSNR of single images"], rows)


def gauge_study(*, dummies: bool) -> GaugeStudy:
    """A gauge study on the twin, of strawberries or of the dummies in their place."""
    design = TwinDesign("strawberry", 10, 3, 3, SEED, os.cpu_count() or 1, dummies)
    return study_on_twin(design, None, lambda: print(".", end="", file=sys.stderr, flush=True))


def gauge_table(study: GaugeStudy) -> str:
    """The components of variation."""
    gauge = study.gauge
    rows = [
        [one.name, f"{one.sigma:.2f}", f"{one.study_percent:.1f}", f"{one.tolerance_percent or 0:.1f}"]
        for one in gauge.components
    ]
    shown = table(["", "standard deviation, mm²", "% of the total variation", "6 of them, % of the tolerance"], rows)
    facts = "\n".join(f"- {name}: {words}." for name, words in study.facts)
    return (
        f"{facts}\n\n{shown}\n\n{aiag_class(gauge)[1]} The interaction is "
        f"{'pooled' if gauge.pooled else 'significant and not pooled'}."
    )


def origin_table(study: GaugeStudy) -> str:
    """Return a table of the gauge study's sources of variation, each with all above it, in % of the tolerance."""
    rows = [[one.name, *(f"{percent:.1f}" for percent in tolerance_percents(one.gauge))] for one in study.origins]
    return table(["what varies, each row with all above it", "EV", "AV", "INT", "GRR"], rows)


def write_gauge() -> None:
    """Make both gauge studies and write their document."""
    fruit, dummies = gauge_study(dummies=False), gauge_study(dummies=True)
    (DOCS / "paper" / "grr-components.png").write_bytes(components_plot(fruit.gauge))
    (DOCS / "paper" / "grr-measurements.png").write_bytes(measurements_plot(fruit.table))
    plots = [
        picture("Components of the variation", "grr-components.png"),
        picture("Every measurement, the operators' means, and the ranges of the repeats", "grr-measurements.png"),
    ]
    tables = {
        "dummies": gauge_table(dummies),
        "dummies-origins": origin_table(dummies),
        "grr": gauge_table(fruit),
        "origins": origin_table(fruit),
        "plots": "\n\n".join(plots),
        "agreement": agreement_table(fruit),
    }
    write_tables(DOCS / "grr.md", tables)


def agreement_table(study: GaugeStudy) -> str:
    """The agreement of the outcome."""
    found = study.agreement
    assert found is not None
    rows = [
        [
            one.operator,
            f"{one.repeated} of {one.parts}",
            f"{one.right} of {one.parts}",
            "not defined" if one.kappa is None else f"{one.kappa:.2f}",
            " of ".join(map(str, one.misses or ())),
            " of ".join(map(str, one.false_alarms or ())),
        ]
        for one in found.operators
    ]
    kappas = ", ".join(f"{a} and {b} {'not defined' if k is None else f'{k:.2f}'}" for a, b, k in found.between)
    header = ["operator", "same decision every time", "right every time", "kappa", "damaged passed", "good diverted"]
    return table(header, rows) + f"\n\nKappa between operators: {kappas}."


def read(path: Path) -> Image:
    """A colour image."""
    image = cv2.imread(str(path))
    if image is None:
        raise SystemExit(f"{path} is not an image that OpenCV reads")
    return np.asarray(image, np.uint8)


def draw(studies: dict[tuple[Kind, str], Study]) -> dict[str, str]:
    """Write the pictures of the document; gives what shows them, by the names of its marks."""
    folder = DOCS / "paper"
    folder.mkdir(exist_ok=True)
    stages: list[list[str]] = []
    for kind in (*FRUITS, Kind.RUBBER_BALL):
        pair = [first(studies[kind, method], PAPER_SAMPLES) for method in ("paper", "robust")]
        widths = [sample.width_mm for sample in pair[0].samples]
        number = pair[0].samples[np.argsort(widths)[len(widths) // 2]].number
        (folder / f"{kind}-curves.png").write_bytes(figures.cohort_curves(pair))
        (folder / f"{kind}-areas.png").write_bytes(figures.areas_at_results(pair))
        (folder / f"{kind}-sample.png").write_bytes(figures.one_curve(pair, number))
        for study in pair:
            (folder / f"{kind}-{study.request.method}.jpg").write_bytes(figures.press_sheet(study, number))
        words = [f"Stages of a press, {kind}, {study.request.method}" for study in pair]
        stages.append(
            [kind, *(picture(word, f"{kind}-{m}.jpg") for word, m in zip(words, ("paper", "robust"), strict=True))]
        )
    curves = [
        [words, *(picture(f"{kind}: {words}", f"{kind}-{name}.png") for kind in FRUITS)]
        for name, words in (
            ("curves", "area over closing, every sample"),
            ("areas", "measured over true area"),
            ("sample", "the fruit of median width"),
        )
    ]
    ball = [
        picture(words, f"rubber_ball-{name}.png")
        for name, words in (("curves", "every press"), ("sample", "one press"))
    ]
    return {
        "curves": table(["", *FRUITS], curves),
        "stages": table(["", "`paper`", "`robust`"], stages),
        "ball-curves": "\n\n".join(ball),
    }


def picture(words: str, name: str) -> str:
    """A picture of the document."""
    return f"![{words}](paper/{name})"


def write_tables(path: Path, tables: dict[str, str]) -> None:
    """Put each table between its two marks in a document."""
    text = path.read_text(encoding="utf-8")
    for name, content in tables.items():
        print(f"\n{name}\n{content}", flush=True)
        marks = re.compile(rf"(<!-- {name} -->\n).*?(<!-- /{name} -->)", re.DOTALL)
        text = marks.sub(lambda found, content=content: f"{found[1]}{content}\n{found[2]}", text)
    path.write_text(text, encoding="utf-8")


def write_csv(folder: Path, document: Path) -> None:
    """Write each table of numbers between the marks of a document as a CSV file of the mark's name."""
    for name, content in re.findall(r"<!-- ([\w-]+) -->\n(.*?)<!-- /\1 -->", document.read_text("utf-8"), re.DOTALL):
        rows = [
            [cell.strip().replace("`", "") for cell in line.strip("|").split("|")]
            for line in content.splitlines()
            if line.startswith("|") and not line.startswith("|---")
        ]
        if rows and "![" not in content:
            with (folder / f"{name}.csv").open("w", encoding="utf-8", newline="") as file:
                csv.writer(file, lineterminator="\n").writerows(rows)


def main() -> None:
    """Measure everything and write it down."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--images", type=Path, default=ROOT.parent / "shared" / "data")
    parser.add_argument(
        "--only",
        choices=["robust", "paper", "gauge"],
        help="measure that method's cohorts and write nothing; gauge: write docs/grr.md alone",
    )
    parser.add_argument("--samples", type=int, default=300, help="of each fruit with the robust method, at least 30")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    if arguments.only == "gauge":
        write_gauge()
        return
    studies: dict[tuple[Kind, str], Study] = {}
    for method in [arguments.only] if arguments.only else ["robust", "paper"]:
        for kind in FRUITS:
            studies[kind, method] = cohort(kind, method, PAPER_SAMPLES if method == "paper" else arguments.samples)
        studies[Kind.RUBBER_BALL, method] = cohort(Kind.RUBBER_BALL, method, BALL_REPEATS)
    if arguments.only:
        return
    makers: dict[str, Callable[[], str]] = {
        "failures": lambda: failure_table(studies),
        "causes": lambda: cause_table(studies),
        "results": lambda: result_table(studies),
        "sizes": lambda: size_table(studies),
        "ball": lambda: ball_table(studies),
        "denoising": lambda: denoising_table(arguments.images),
    }
    write_tables(DOCS / "paper.md", {**{name: make() for name, make in makers.items()}, **draw(studies)})
    write_csv(DOCS / "paper", DOCS / "paper.md")
    write_gauge()


if __name__ == "__main__":
    main()

"""Document of the constants: its sections, each written by one part of the benchmark and left by the others."""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fit.cost import costs, weighted
from fit.evaluation import LARGE_ERROR, LEAST_MM2, Scores
from fit.parts import Groups

DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "robust-constants.md"
TITLE = "# The robust method's constants"
INTRODUCTION = """
Written by `./run bench fit --all`, section by section. The source, `station/vision/constants.py`, has each constant's
unit, meaning and origin; [the robust method](robust.md) what each stage does; [For
developers](developer.md#change-a-constant-of-the-robust-method) how to check a change.
"""
COLUMNS = (
    "data set",
    "weight",
    "presses, images",
    "error: mean",
    "median",
    "p95",
    "IoU",
    "judged",
    "wrong of judged",
    "false areas, judged",
    "drops",
    "Spearman >= 0.99",
    "cost",
)
SECTIONS = ("Data sets and cost", "Constants", "Stages", "Fit", "Reliability", "Reference check", "Fixed numbers")


def write_section(name: str, lines: Sequence[str]) -> None:
    """Write one section of the document and keep the others."""
    texts = {}
    if DOCUMENT.exists():
        for part in DOCUMENT.read_text().split("\n## ")[1:]:
            title, _, text = part.partition("\n")
            texts[title] = text.strip()
    texts[name] = "\n".join(lines).strip()
    sections = [f"## {title}\n\n{texts[title]}\n" for title in SECTIONS if title in texts]
    DOCUMENT.write_text("\n".join([f"{TITLE}\n{INTRODUCTION}", *sections]))
    print("\n".join(lines), flush=True)


def machine() -> str:
    """Return the number of cores and the load of the machine, in words."""
    return f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}"


def evaluation_table(scores: Scores, groups: Groups) -> list[str]:
    """Return a table of the measurements on one part, data set by data set."""
    lines = [
        f"| {' | '.join(COLUMNS)} |",
        "|---" * len(COLUMNS) + "|",
    ]
    per_set = costs(scores, groups)
    for name, presses in scores.items():
        steps = [step for press in presses for step in press.steps]
        contacts = [step for step in steps if step.true_mm2 > LEAST_MM2]
        empty = [step for step in steps if step.true_mm2 == 0]
        judged = [step for step in contacts if step.judged]
        ordered = [press.spearman for press in presses if not np.isnan(press.spearman)]
        cells = [""] * 6
        if groups[name].scored == "found":
            light = [step for step in steps if 0 < step.true_mm2 <= LEAST_MM2 + 0.5]
            cells[0] = f"{sum(step.has_area for step in light)} of {len(light)} found"
        elif contacts:
            errors = [min(1.0, step.error) for step in contacts]
            cells = [
                *(f"{value:.3f}" for value in (np.mean(errors), np.median(errors), np.quantile(errors, 0.95))),
                f"{np.mean([step.overlap for step in contacts]):.3f}",
                f"{len(judged)} of {len(contacts)}",
                str(sum(step.error > LARGE_ERROR for step in judged)),
            ]
        false = f"{sum(s.has_area for s in empty)}, {sum(s.judged for s in empty)} of {len(empty)}" if empty else ""
        drops = str(sum(step.dropped for step in steps)) if groups[name].followed else ""
        ranks = f"{sum(one >= 0.99 for one in ordered)} of {len(ordered)}" if ordered else ""
        cells += [false, drops, ranks, f"{per_set[name]:.4f}"]
        lines.append(f"| {name} | {groups[name].weight:g} | {len(presses)}, {len(steps)} | " + " | ".join(cells) + " |")
    return [*lines, f"| **all** {'| ' * 11}| {weighted(per_set, groups):.4f} |"]

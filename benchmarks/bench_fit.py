"""Fit of the robust method's constants, and what defends them: sensitivity, stages, reliability.

Run with `./run bench fit` for the search alone, `--all` for everything (about an hour on two cores) or one of the other
parts. Each part writes its section of `docs/robust-constants.md`. `--check NAME=VALUE ...` prints what changed
constants cost and writes nothing. Images are rendered once and stored in `--cache`.
"""

import argparse
import sys
import tempfile
from pathlib import Path

import cv2
from fit import document
from fit.cost import costs, weighted
from fit.evaluation import Trial
from fit.fixed import fixed_numbers
from fit.fixed import table as fixed_table
from fit.parts import groups
from fit.progress import report
from fit.reference import reference_table
from fit.reliability import PICTURE, reliability
from fit.runner import Runner
from fit.search import fitted_names, found_table, search
from fit.sensitivity import (
    ERRORS,
    LEAST_EFFECT,
    RECIPE,
    far_table,
    out_table,
    sensitivity,
    store,
    stored,
    table,
    trial,
    values,
)
from fit.stages import stages_table

ROOT = Path(__file__).resolve().parents[1]
BEFORE, BEFORE_DATE = 171, "2026-11-22"
"""Numbers of the method, counted as `fixed.py` counts, before there was a fit."""
COST = """
The data sets have two parts: one to fit on, and one for validation. A value is taken only where both gain, so that the
figures of both are too good by what that choice is worth; neither is a test. Real presses and real backgrounds are
split into even and odd numbers; the twin's presses have seeds of their own in each part. All images are at the method's
working size. Border contacts and real presses are measured one by one; fruit and soft bodies are
followed from step to step, from before the first touch.

| data set | what it shows |
|---|---|
| real ball | presses of a ball on a real sensor, against hand-annotated circles |
| untouched | real backgrounds against themselves, with measured noise and drift |
| untouched, compressed | the same with JPEG of quality 30 to 60 and with MPEG-4 video |
| untouched twin | units of the twin 5 and 11 s after their reference: plain, drift doubled, dead LED, dirt |
| moved debris | untouched twin; some specks of debris have moved since the reference |
| other unit | untouched real unit against another unit's reference |
| weak contact | contacts of about 0.7 to 2 mm² of four fruits, three frames a step |
| fruit, bruised | fruit of the twin in seven conditions, from the first touch to a firm grip |
| border | contacts that the border cuts, against their visible part |
| large ball | firm balls of 26 to 44 mm that leave little background |
| soft ball ... long | the twin's soft bodies, from no touch to a full field |
| fruit alone ... soft alone | images of the same presses, each measured by itself; of soft bodies every third |
| shadow | untouched real backgrounds with a soft shadow, or a stain of one colour |

A data set's cost is the sum of these means; a perfect measurement has 0.

- Over contacts above 2 mm²: the error of the area, at most 1; what the outline's intersection over union with the
  truth lacks to 1; 1 more for a judged area that is wrong by 35 % or more, rising from nothing at 15 %; 0.05 more for
  one that is not judged; 0.5 more for a drop, a judged area more than 25 % under an earlier judged one of its press. An
  area is worth judging if it is wrong in fewer than one of twenty cases.
- Over untouched frames: 1 for a false area, 1 more if it is judged. Against another unit's reference, 1 for what is
  judged.
- Over weak contacts: 1 for one that is not found.
- Over followed presses: 0.1 for a Spearman correlation of measured and true area under 0.99.

The cost is the weighted mean over the data sets. An effect is a difference of two costs on the same images. Its
standard error (after ±) comes from 400 redraws of the presses, each of its own seed: smaller effects are the choice of
seeds.
"""


def evaluate(runner: Runner) -> None:
    """Write the shipped constants' results on the part for validation; `--check` alone prints both parts."""
    fitted = weighted(costs(runner.shipped(0), runner.parts[0]), runner.parts[0])
    lines = [
        COST.strip(),
        "",
        f"On the part to fit on the cost is {fitted:.4f}; on the one for validation:",
        "",
        *document.evaluation_table(runner.shipped(1), runner.parts[1]),
    ]
    document.write_section("Data sets and cost", lines)


def constants(runner: Runner, cache: Path) -> None:
    """Write the sensitivity, for the document and for the search."""
    found = sensitivity(runner)
    store(cache / "sensitivity.json", found)
    lines = [
        "Change of the cost, on the part to fit on, when one constant is changed; the recipe's parameters are at their",
        f"defaults. `*` marks an effect above {LEAST_EFFECT:g} and above {ERRORS:g} standard errors; one without",
        "is left out. What suffers is the data set with the largest share, with the change of its own cost.",
        "",
        *table(found),
        "",
        "### Changed far",
        "",
        "Those that matter only so.",
        "",
        *far_table(found),
        "",
        "### Left out",
        "",
        "Those that matter neither so: the value at which a constant does nothing, and what that costs.",
        "",
        *out_table(found),
    ]
    document.write_section("Constants", lines)


def fixed() -> None:
    """Write the numbers that the fit leaves as they are."""
    count, fitted = sum(len(one.names) for one in fixed_numbers()), len(values()) - len(RECIPE)
    lines = [
        f"The method has {fitted} constants, each with its unit, meaning and origin in `station/vision/constants.py`,",
        f"and {count} numbers that its modules declare: how finely something is computed, what a sensor cannot show,",
        f"and sizes of places. That makes {fitted + count}. Counted alike there were {BEFORE} on {BEFORE_DATE}, before",
        "the pipeline was rebuilt and the fit written. What was left out and what that cost is in",
        "[the history](decisions/robust-method-history.md).",
        "",
        *fixed_table(),
    ]
    document.write_section("Fixed numbers", lines)


def stages(runner: Runner) -> None:
    """Write the stages' table."""
    lines = [
        "First the cost with all stages, then its change when one stage is left out: positive is what the stage",
        "contributes. Data sets: mean of both parts; empty where nothing changes.",
        "",
        *stages_table(runner),
    ]
    document.write_section("Stages", lines)


def fit(runner: Runner, cache: Path) -> None:
    """Search for better values and write them beside the shipped ones."""
    found = stored(cache / "sensitivity.json")
    if found is None:
        constants(runner, cache)
        found = stored(cache / "sensitivity.json") or []
    names = fitted_names(found)
    report(f"{len(names)} constants: {', '.join(names)}")
    moved = search(runner, names)
    lines = [
        "Coordinate search on the part to fit on, over the constants of origin `fit` that gain a standard error when",
        "changed by a fifth: 0.7, 0.85, 1.2 and 1.4 times the value, in two rounds at most; a move has to gain more",
        "than two standard errors. Constants are changed by hand, and only where the part for validation gains too.",
        "",
        *found_table(runner, moved),
    ]
    document.write_section("Fit", lines)


def reference(runner: Runner, images: Path) -> None:
    """Write how far the reference check separates a unit from another."""
    lines = [
        "The statistic of `station/vision/reference_check.py` over its threshold; above 1 a frame is flagged as of",
        "another unit. The thresholds were chosen on these images, and on them with noise, drift and compression. The",
        "twin's units share a few modes of light, so that some cannot be distinguished; a lens that has fogged over",
        "takes away the pattern by which a unit is known.",
        "",
        *reference_table(runner.parts, images),
    ]
    document.write_section("Reference check", lines)


def check(runner: Runner, changes: list[str]) -> None:
    """Print what changed constants cost, on both parts."""
    changed = Trial()
    for change in changes:
        name, _, text = change.partition("=")
        known = values()
        key = name if name in known else f"recipe: {name}"
        if key not in known:
            raise SystemExit(f"{name}: no such constant; there are {', '.join(known)}")
        try:
            value = type(known[key])(text)
        except ValueError as error:
            raise SystemExit(
                f"{change}: the value is no number; write {name}={known[key]:g} or another number"
            ) from error
        changed = trial(key, value, changed)
    for part, name in enumerate(("to fit on", "validation")):
        before = runner.shipped(part)
        print(f"\n{name}")
        if not changes:
            print("\n".join(document.evaluation_table(before, runner.parts[part])))
            continue
        after = runner.scores(changed, part)
        old, new = costs(before, runner.parts[part]), costs(after, runner.parts[part])
        for key in old:
            print(f"  {key:22} {old[key]:.4f} -> {new[key]:.4f}  {new[key] - old[key]:+.4f}")
        effect, error = runner.effect(after, before, part)
        print(f"  all: {effect:+.4f} ± {error:.4f} (negative is better)")


def main() -> None:
    """Run the parts that are wanted."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--images", type=Path, default=ROOT.parent / "shared" / "data")
    parser.add_argument("--cache", type=Path, default=Path(tempfile.gettempdir()) / "station-fit")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--all", action="store_true", help="every part")
    parser.add_argument("--evaluate", action="store_true", help="the shipped constants on every data set")
    parser.add_argument("--sensitivity", action="store_true", help="what changing each constant costs")
    parser.add_argument("--stages", action="store_true", help="what each stage contributes")
    parser.add_argument("--fit", action="store_true", help="search for better values; what runs without any option")
    parser.add_argument("--reliability", action="store_true", help="wrong areas by the least confidence")
    parser.add_argument("--reference", action="store_true", help="how far the reference check tells units apart")
    parser.add_argument("--check", nargs="*", metavar="NAME=VALUE", help="print what changes cost; write nothing")
    wanted = parser.parse_args()
    cv2.setNumThreads(1)
    parts = [groups(part, wanted.images, wanted.cache) for part in ("fit", "validation")]
    with Runner(parts, wanted.processes) as runner:
        if wanted.check is not None:
            check(runner, wanted.check)
            return
        others = (wanted.evaluate, wanted.sensitivity, wanted.stages, wanted.reliability, wanted.reference)
        if wanted.evaluate or wanted.all:
            evaluate(runner)
        if wanted.stages or wanted.all:
            stages(runner)
        if wanted.sensitivity or wanted.all:
            constants(runner, wanted.cache)
        if wanted.fit or wanted.all or not any(others):
            fit(runner, wanted.cache)
        if wanted.reliability or wanted.all:
            lines = reliability(wanted.images, wanted.processes)
            document.write_section("Reliability", lines)
            report(f"curve in {PICTURE}")
        if wanted.reference or wanted.all:
            reference(runner, wanted.images)
        fixed()
    report(f"{document.DOCUMENT} is written")


if __name__ == "__main__":
    sys.exit(main())

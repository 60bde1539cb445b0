"""Stages: what each one contributes, by the cost when it is left out, on every data set."""

from fit.cost import costs
from fit.evaluation import Trial
from fit.runner import Runner
from station.vision.robust import STAGES


def stages_table(runner: Runner) -> list[str]:
    """The stages' table, on the part to fit on and the part for validation together."""
    trials = [Trial(), *(Trial(without=frozenset({stage})) for stage in STAGES)]
    runs = [runner.run(f"stages, part {part + 1}", trials, part) for part in range(len(runner.parts))]
    names = list(runner.parts[0])
    lines = [
        "| left out | " + " | ".join(names) + " | all: fit | all: validation |",
        "|---" * (len(names) + 3) + "|",
    ]
    base = [scores[0] for scores in runs]
    for number, stage in enumerate(("nothing: the cost", *STAGES)):
        cells: list[str] = []
        totals: list[str] = []
        per_set: list[dict[str, float]] = []
        for part, scores in enumerate(runs):
            now, before = scores[number], base[part]
            if now is None or before is None:
                raise SystemExit(f"{stage}: no method without it")
            after = costs(now, runner.parts[part])
            reference = costs(before, runner.parts[part])
            per_set.append({name: after[name] - (reference[name] if number else 0.0) for name in names})
            effect, error = runner.effect(now, before, part)
            total = sum(after[n] * runner.parts[part][n].weight for n in names)
            weight = sum(runner.parts[part][n].weight for n in names)
            totals.append(f"{effect:+.4f} ± {error:.4f}" if number else f"{total / weight:.4f}")
        for name in names:
            mean = sum(one[name] for one in per_set) / len(per_set)
            cells.append((f"{mean:+.3f}" if number else f"{mean:.3f}") if abs(mean) >= 0.0005 else "")
        lines.append(f"| {stage} | " + " | ".join([*cells, *totals]) + " |")
    return lines

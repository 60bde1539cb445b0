"""The area after the shipped pause of a step, beside that after a longer one, on fruit of the twin with its creep.

Run with `./run bench pause`; writes the table of `docs/decisions/0085-pause-of-a-step.md`. The areas are the true ones
at the last damage limit, of 60 sound and 60 severely damaged fruit of each kind.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from sections import write
from sorting.specimens import KINDS, Task, draw
from sorting.sweep import FRAME_S

from station.settings.recipe import find_recipe
from station.twin.contact import FruitOnGel
from station.twin.gel import Gel
from station.twin.squeeze import Squeeze

DOCUMENT = Path(__file__).resolve().parents[1] / "docs" / "decisions" / "0085-pause-of-a-step.md"
LONGER_PAUSE_S = 0.2
"""The shipped recipes' until 2026-11-25."""
GROUPS = ("sound", "severe")
FRUIT = 60
"""Of each kind and group."""


def ratio(task: Task) -> float:
    """The true area after steps with the shipped pause over that after longer ones."""
    one, recipe = draw(task), find_recipe(task.kind)
    gel = Gel(mm_per_px=one.mm_per_px)
    on_gel, closing_mm = FruitOnGel(one.fruit, one.pose, gel), recipe.damage.area[-1].closing_mm
    steps, frames_s = round(closing_mm / recipe.steps.step_mm), recipe.imaging.frames_per_step * FRAME_S

    def area_mm2(pause_s: float) -> float:
        held_s = closing_mm / recipe.gripper.speed_mm_s + steps * (pause_s + frames_s)
        return on_gel.pressed(Squeeze(one.fruit, gel, held_s).at(closing_mm)).true_area_mm2

    return area_mm2(recipe.imaging.settle_s) / area_mm2(LONGER_PAUSE_S)


def table(tasks: Sequence[Task]) -> list[str]:
    """Return a table of the area after the shipped pause over that after the longer one, by kind of fruit."""
    names = ("fruit", "pause, s", "fruit pressed", f"area over that after {LONGER_PAUSE_S:g} s: median", "furthest")
    lines = [f"| {' | '.join(names)} |", "|---" * len(names) + "|"]
    for kind in KINDS:
        ratios = [ratio(task) for task in tasks if task.kind == kind]
        furthest = max(ratios, key=lambda each: abs(each - 1))
        pause_s = find_recipe(kind).imaging.settle_s
        lines.append(f"| {kind} | {pause_s:g} | {len(ratios)} | {np.median(ratios):.4f} | {furthest:.4f} |")
    return lines


def main() -> None:
    """Compare, print the table, and put it into the decision."""
    tasks = [Task(kind, group, "tuning", number) for kind in KINDS for group in GROUPS for number in range(FRUIT)]
    lines = table(tasks)
    print("\n".join(lines))
    write(DOCUMENT, {"pauses": lines})


if __name__ == "__main__":
    main()

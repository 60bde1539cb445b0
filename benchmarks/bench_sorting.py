"""Sound, severely and mildly damaged fruit of the twin, decided by the station's own procedure and judge.

Run with `./run bench sorting`. Closings are imaged once and stored in `state/sorting`, by a hash of the code that
draws and measures them; judging them by another recipe then takes seconds. `--count 300` images about 1,800 closings of
each kind, 75 minutes on two cores, and can be interrupted and resumed. Writes the tables of `docs/sorting.md`, and the
first one into `README.md`: with `--kinds` the rows of these. Other seeds print them only: what is tuned on must not be
published as the result. `--limits` compares area limits on sound and mildly damaged fruit, to choose one.
"""

import argparse
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from sections import with_rows, write
from sorting import tables
from sorting.cycle import Inspected, Practice, Unmeasured, inspect
from sorting.presses import PRESSED_ON, Closing, PressCache
from sorting.specimens import KINDS, SEEDS, SOUND, Task

from station.settings.recipe import find_recipe
from station.settings.recipe_model import Recipe
from station.twin.damage import Severity
from station.twin.fruit import Kind

ROOT = Path(__file__).resolve().parents[1]
DOCUMENT, README = ROOT / "docs" / "sorting.md", ROOT / "README.md"
CACHE = ROOT / "state" / "sorting"
FRUIT = 300
"""Of each kind and damage, for the page."""
KEYS = {"errors": 1, "why": 1, "worth": 2, "spared": 2}
"""How many cells of each table identify its row."""
AS_PLACED = Practice(centring=False, second_press=False)
OF_EACH_GROUP = 100
"""Fruit on which the practices are compared: without a size nearly all are pressed twice."""


def decided(
    tasks: Sequence[Task], recipes: Mapping[str, Recipe], practices: Iterable[Practice], cache: PressCache
) -> dict[Practice, list[Inspected]]:
    """Inspect fruit by several practices; closings that are not measured yet are, as many as possible at once."""
    while True:
        wanted: list[Closing] = []
        found: dict[Practice, list[Inspected]] = {}
        for practice in practices:
            found[practice] = []
            for task in tasks:
                try:
                    found[practice].append(inspect(task, recipes[task.kind], practice, cache.get))
                except Unmeasured as missing:
                    wanted.append(missing.closing)
        if not wanted:
            return found
        cache.measure(wanted)


def without_stop(recipe: Recipe) -> Recipe:
    """The recipe as before there was `stop_when_decided`: pressed on to the early stop."""
    return recipe.model_copy(update={"steps": recipe.steps.model_copy(update={"stop_when_decided": False})})


def with_limits(recipe: Recipe, limits: str) -> Recipe:
    """The recipe with other area limits, mm², separated by commas."""
    areas = [float(limit) for limit in limits.split(",")]
    thresholds = zip(recipe.damage.area, areas, strict=True)
    changed = tuple(threshold.model_copy(update={"area_mm2": area}) for threshold, area in thresholds)
    return recipe.model_copy(update={"damage": recipe.damage.model_copy(update={"area": changed})})


def compare_limits(tasks: Sequence[Task], recipe: Recipe, limits: Iterable[str], cache: PressCache) -> None:
    """Print both errors by each choice of the limits of one kind."""
    print("\n".join(tables.EXCHANGE))
    for chosen in limits:
        recipes = {recipe.name: with_limits(recipe, chosen)}
        print(tables.exchange(chosen, decided(tasks, recipes, [Practice()], cache)[Practice()]), flush=True)


def named_kinds(lines: Sequence[str], kinds: Iterable[Kind]) -> list[str]:
    """A table's head and the rows of some kinds."""
    return [*lines[:2], *(line for line in lines[2:] if any(f"| {kind} |" in line for kind in kinds))]


def main() -> None:
    """Inspect, print the tables, and write them where they are the result."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=FRUIT, help="fruit of each kind and damage; a third with a patch")
    parser.add_argument("--kinds", nargs="+", type=Kind, choices=KINDS, default=KINDS)
    parser.add_argument("--seeds", nargs="+", choices=SEEDS, default=["judging"])
    parser.add_argument("--tables", nargs="+", choices=KEYS, default=list(KEYS), help="make these again; else all")
    parser.add_argument("--recipes", type=Path, metavar="DIR", help="the folder of the recipes; else the shipped ones")
    parser.add_argument("--limits", nargs="+", metavar="MM2,…", help="compare these limits of the one kind in --kinds")
    parser.add_argument("--processes", type=int, default=2)
    options = parser.parse_args()
    # No limit on the area finds a patch: a third of the fruit shows that well enough.
    counts: dict[str, int] = dict.fromkeys((SOUND, Severity.SEVERE, Severity.MILD), options.count)
    counts[Severity.PATCH] = options.count // 3
    tasks = [
        Task(kind, group, seeds, number)
        for seeds in options.seeds
        for kind in options.kinds
        for group, count in counts.items()
        for number in range(count)
    ]
    recipes: dict[str, Recipe] = {kind: find_recipe(kind, options.recipes) for kind in options.kinds}
    cache = PressCache(CACHE, options.processes, options.recipes)
    if options.limits:
        (kind,) = options.kinds
        two_groups = [task for task in tasks if task.group in {SOUND, Severity.MILD}]
        compare_limits(two_groups, recipes[kind], options.limits, cache)
        return
    sections: dict[str, list[str]] = {}
    if {"errors", "why"} & set(options.tables):
        all_of_it = decided(tasks, recipes, [Practice()], cache)[Practice()]
        sections |= {"errors": tables.errors(all_of_it), "why": tables.diverted_why(all_of_it)}
    if "worth" in options.tables:
        some = [task for task in tasks if task.number < OF_EACH_GROUP and task.group != Severity.PATCH]
        compared = decided(some, recipes, tables.PRACTICES.values(), cache)
        sections["worth"] = tables.worth({name: compared[practice] for name, practice in tables.PRACTICES.items()})
    if "spared" in options.tables:
        sound = [task for task in tasks if task.group == SOUND and task.number < PRESSED_ON]
        pressed_on = {kind: without_stop(recipe) for kind, recipe in recipes.items()}
        before, after = (decided(sound, by, [AS_PLACED], cache)[AS_PLACED] for by in (pressed_on, recipes))
        sections["spared"] = tables.spared(before, after)
    for lines in sections.values():
        print("\n".join(lines), end="\n\n")
    if options.seeds == ["judging"] and options.count == FRUIT and options.recipes is None:
        of_kinds = {name: named_kinds(lines, options.kinds) for name, lines in sections.items()}
        rows = {name: with_rows(DOCUMENT, name, lines, KEYS[name]) for name, lines in of_kinds.items()}
        write(DOCUMENT, rows)
        if "errors" in rows:
            write(README, {"errors": rows["errors"]})


if __name__ == "__main__":
    main()

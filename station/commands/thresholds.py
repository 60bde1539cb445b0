"""`station thresholds`: limits from fruit that a person has marked good and bad."""

import base64
import io
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
import jinja2
from matplotlib.figure import Figure

from station.errors import BadInputError, StationError
from station.records.database import reading, records_folder
from station.records.marks import Mark, read_marked
from station.settings.configuration import load_configuration
from station.settings.recipe import Recipe, find_recipe, recipe_files
from station.settings.recipe_text import with_values
from station.whatif.limits import (
    Interval,
    Limit,
    area_most_mm2,
    fewest_good,
    growth_most_mm2_per_mm,
    propose,
    rate_interval,
)
from station.whatif.marks import read_marks
from station.whatif.replay import recipe_of_snapshot, replay
from station.whatif.stored import StoredPress, read_stored, sequences, snapshots

_PART = 500
_ROUND = 0.5


@click.command("thresholds")
@click.option("--recipe", "name", required=True, metavar="NAME", help="The fruit's recipe, by its name.")
@click.option(
    "--marks", type=click.Path(path_type=Path), metavar="CSV",
    help="With sequence,mark. [default: what `station records mark` has told]",
)  # fmt: skip
@click.option("--lots", multiple=True, metavar="LOT", help="Only these, may be repeated. [default: all]")
@click.option(
    "--false-rejects", "rate", default=0.02, show_default=True, metavar="SHARE", type=click.FloatRange(0.0001, 0.5),
    help="The wanted share of good fruit that is rejected by the limits, all of them together.",
)  # fmt: skip
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="DIR", help="Where the results go.")
@click.option("--draft", type=click.Path(path_type=Path), metavar="FILE", help="Write a recipe with these limits too.")
@click.option("--config", metavar="FILE", type=click.Path(path_type=Path), help="The station.yaml to use.")
def thresholds(
    name: str,
    marks: Path | None,
    lots: tuple[str, ...],
    rate: float,
    out: Path,
    draft: Path | None,
    config: Path | None,
) -> None:
    """Propose damage thresholds from marked fruit, with what is unsure about them.

    Writes DIR/thresholds.html, with a histogram for each limit, and thresholds.json. Nothing is put in force: a recipe
    written with --draft goes the way of every draft, as by `station recipes import`.
    """
    site = load_configuration(config)
    recipe, folder = find_recipe(name, site.recipes_folder), records_folder(site.home)
    marked = _told_marks(folder) if marks is None else read_marks(marks)
    stored, own = _marked(folder, recipe.name, lots, set(marked))
    good, bad = ([each for each in stored if marked[each.sequence] == mark] for mark in ("good", "bad"))
    if not good:
        raise BadInputError(
            f"{marks or folder}: none of the fruit marked good is a judged {recipe.name} in the records"
        )
    limits = _limits(good, bad, own, recipe, rate)
    proposed, text = _draft(recipe, limits, name, site.recipes_folder)
    told = _told(limits, good, bad, own, proposed, rate)
    try:
        out.mkdir(parents=True, exist_ok=True)
        (out / "thresholds.json").write_text(json.dumps(told, indent=2) + "\n", encoding="utf-8")
        (out / "thresholds.html").write_text(_page(recipe, limits, told), encoding="utf-8")
        if draft is not None:
            draft.write_text(text, encoding="utf-8")
    except OSError as error:
        raise StationError(f"{error.filename or out}: {error.strerror or error}; free space and try again") from error
    for line in _lines(told):
        click.echo(line)
    click.echo(f"see {out / 'thresholds.html'}" + (f"; the draft is {draft}" if draft else ""))


def _told_marks(folder: Path) -> dict[int, Mark]:
    """What people have told of fruit by `station records mark`, or on the panel."""
    with reading(folder) as connection:
        told: dict[int, Mark] = {each.sequence: each.mark for each in read_marked(connection)}
    if not told:
        raise BadInputError("no fruit is marked: tell some by `station records mark`, or give --marks")
    return told


def _marked(
    folder: Path, name: str, lots: Sequence[str], marked: set[int]
) -> tuple[list[StoredPress], dict[str, Recipe]]:
    """The marked inspections that have a curve, with the recipes that they were judged by."""
    with reading(folder) as connection:
        wanted = [sequence for sequence in sequences(connection, name, lots, None) if sequence in marked]
        texts = snapshots(connection, name)
        parts = [wanted[start : start + _PART] for start in range(0, len(wanted), _PART)]
        stored = [each for part in parts for each in read_stored(connection, part, folder, with_images=False)]
    own = {sha256: recipe for sha256, text in texts.items() if (recipe := recipe_of_snapshot(text)) is not None}
    return [each for each in stored if each.recipe_sha256 in own and each.press.onset_mm is not None], own


def _limits(
    good: Sequence[StoredPress], bad: Sequence[StoredPress], own: dict[str, Recipe], recipe: Recipe, rate: float
) -> list[Limit]:
    """Each limit gets its share of the wanted rate, so that all together reject no more (Bonferroni)."""
    closings = [each.closing_mm for each in recipe.damage.area]
    share = rate / (len(closings) + 1)
    found: list[Limit] = []
    for closing_mm in (*closings, None):
        values = [
            [
                growth_most_mm2_per_mm(each.press, own[each.recipe_sha256])
                if closing_mm is None
                else area_most_mm2(each.press, own[each.recipe_sha256], closing_mm)
                for each in group
            ]
            for group in (good, bad)
        ]
        limit = propose(values[0], values[1], closing_mm, share)
        if limit is None:
            what = "growth" if closing_mm is None else f"area at {closing_mm:g} mm of closing"
            raise BadInputError(f"no good fruit tells its {what}: mark some that were pressed so far")
        found.append(limit)
    return found


def _draft(recipe: Recipe, limits: Sequence[Limit], name: str, folder: Path | None) -> tuple[Recipe, str]:
    """The recipe's file with the limits, rounded up; the early stop is raised where it has to be."""
    areas = [_rounded(limit.value) for limit in limits if limit.closing_mm is not None]
    areas = [max(areas[: place + 1]) for place in range(len(areas))]  # they do not fall with closing
    growth = _rounded(limits[-1].value)
    changes: dict[str, Any] = {f"damage.area[{place}].area_mm2": area for place, area in enumerate(areas)}
    changes["damage.growth_mm2_per_mm"] = growth
    changes["early_stop.area_mm2"] = max(recipe.early_stop.area_mm2, areas[-1])
    changes["early_stop.growth_mm2_per_mm"] = max(recipe.early_stop.growth_mm2_per_mm, growth)
    for path in recipe_files(folder):
        if find_recipe(path).name == recipe.name:
            text, proposed = with_values(path.read_text(encoding="utf-8-sig"), changes, str(path))
            return proposed, text
    raise BadInputError(f"recipe {name}: there is no file of it to write a draft from")


def _told(
    limits: Sequence[Limit], good: Sequence[StoredPress], bad: Sequence[StoredPress], own: dict[str, Recipe],
    proposed: Recipe, rate: float,
) -> dict[str, Any]:  # fmt: skip
    """All figures by name; the rates are those of the judge, by the proposed recipe."""
    rates = {}
    for name, group in (("good", good), ("bad", bad)):
        after = [replay(each, own[each.recipe_sha256], proposed).after for each in group]
        decided = [each for each in after if each != "UNDECIDABLE"]
        rejected = sum(each != "PASS" for each in decided)
        rates[name] = {
            "marked": len(group),
            "decided": len(decided),
            "rejected": rejected,
            "rejected_share": rejected / len(decided) if decided else None,
            "interval": _pair(rate_interval(rejected, len(decided))),
        }
    return {
        "wanted_false_rejects": rate,
        "limits": [
            {
                "closing_mm": limit.closing_mm,
                "unit": "mm²/mm" if limit.closing_mm is None else "mm²",
                "limit": limit.value,
                "interval": _pair(limit.interval),
                "good": len(limit.good),
                "bad": len(limit.bad),
                "not_known": limit.unknown,
                "share_of_false_rejects": limit.rate,
                "good_needed": fewest_good(limit.rate),
            }
            for limit in limits
        ],
        "by_the_proposed_recipe": rates,
    }


def _lines(told: dict[str, Any]) -> list[str]:
    lines = []
    for limit in told["limits"]:
        what = "growth" if limit["closing_mm"] is None else f"area at {limit['closing_mm']:g} mm"
        low, high = ("not known" if end is None else f"{end:.1f}" for end in limit["interval"])
        value = f"{limit['limit']:.1f} {limit['unit']}"
        lines.append(f"{what}: {value}, 95 % interval {low} to {high}, from {limit['good']} good fruit")
        if limit["interval"][1] is None:
            lines.append(f"  too few: {limit['good_needed']} good fruit are needed for the interval's upper end")
        if limit["not_known"]:
            lines.append(f"  {limit['not_known']} marked fruit do not tell it: their steps ended before")
    for name, rate in told["by_the_proposed_recipe"].items():
        low, high = ("not known" if end is None else f"{100 * end:.1f} %" for end in rate["interval"])
        lines.append(
            f"{name} fruit rejected by the proposed recipe: {rate['rejected']} of {rate['decided']} decided "
            f"({rate['marked']} marked), 95 % interval {low} to {high}"
        )
    return lines


def _rounded(value: float) -> float:
    return math.ceil(value / _ROUND) * _ROUND


def _pair(interval: Interval) -> list[float | None]:
    return [interval.low, interval.high]


_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Thresholds: {{ title }}</title>
<style>body { font: 15px/1.45 system-ui, sans-serif; max-width: 900px; margin: 0 auto; padding: 20px 16px; }
img { max-width: 100%; }</style></head><body>
<h1>Thresholds: {{ title }}</h1>
{% for line in lines %}<p>{{ line }}</p>{% endfor %}
{% for picture in pictures %}<img src="{{ picture }}" alt="histogram of good and bad fruit">{% endfor %}
</body></html>
"""


def _page(recipe: Recipe, limits: Sequence[Limit], told: dict[str, Any]) -> str:
    pictures = [_histogram(limit) for limit in limits]
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    return environment.from_string(_PAGE).render(title=recipe.title, lines=_lines(told), pictures=pictures)


def _histogram(limit: Limit) -> str:
    """Good and bad beside each other, with the limit and its interval; a data URI."""
    figure = Figure(figsize=(7.2, 3.0), layout="constrained")
    axes = figure.add_subplot()
    axes.hist([limit.good, limit.bad], bins=30, label=["good", "bad"], color=["#1f4e79", "#b3261e"])
    axes.axvline(limit.value, color="#222222")
    if limit.interval.low is not None and limit.interval.high is not None:
        axes.axvspan(limit.interval.low, limit.interval.high, color="#999999", alpha=0.3)
    growth = limit.closing_mm is None
    axes.set_xlabel("growth [mm²/mm]" if growth else f"area at {limit.closing_mm:g} mm of closing [mm²]")
    axes.set_ylabel("fruit")
    axes.legend(frameon=False)
    data = io.BytesIO()
    figure.savefig(data, format="png", dpi=110)
    return "data:image/png;base64," + base64.b64encode(data.getvalue()).decode()

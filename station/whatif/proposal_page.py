"""Report of a proposed limit: sentences, histogram of good and bad fruit, both errors over the limit."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from station.charts.area_chart import report_style
from station.charts.report import data_uri, png, templates
from station.whatif.proposal import Proposal


def lines_of(figures: dict[str, Any]) -> list[str]:
    """Describe a proposal, by its figures, in sentences for the terminal and the page."""
    best = figures["proposed"]
    cost, share = figures["false_accept_cost"], figures["damaged_share"]
    costs = f"costs {cost:g} sound ones diverted and {100 * share:g} % are damaged"
    lines = [
        f"proposed: {best['limit_mm2']:.1f} mm² at {best['closing_mm']:g} mm, where a damaged fruit passed {costs}",
        f"of the marked fruit: {_of(best['good_diverted'])} good diverted, {_of(best['bad_passed'])} bad passed",
    ]
    if best["left_out"] is None:
        lines.append("too few to try the limit on fruit that it was not chosen on: two of either kind are needed")
    else:
        left_out = best["left_out"]
        lines.append(
            f"each left out once, judged by what the others propose: {_of(left_out['good_diverted'])} good diverted, "
            f"{_of(left_out['bad_passed'])} bad passed"
        )
    needed = best["bad_needed_to_show"]
    shares = ", ".join(f"{number} to show that at most {100 * float(rate):g} % pass" for rate, number in needed.items())
    lines.append(f"{best['bad_passed']['of']} bad fruit, none of them passed, would not show much: it takes {shares}")
    if found := best["exponent_of_these_fruit"]:
        lines.append(
            f"exponent of the size: {best['exponent']:g}; these {found['fruit']} fruit by themselves give "
            f"{found['value']:.2f} ± {found['standard_error']:.2f}"
        )
    if best["at_least"]:
        lines.append(
            f"{best['at_least']} fruit ended before {best['closing_mm']:g} mm: their area is only known to be larger"
        )
    lines.extend(f"{number} marked fruit left out: {why}" for why, number in figures["of_other_revisions"].items())
    if best["not_known"]:
        lines.append(f"{best['not_known']} marked fruit are not used: a fault ended their steps")
    lines.extend(
        f"at {other['closing_mm']:g} mm: {other['limit_mm2']:.1f} mm², costs {_times(other, best)}"
        for other in figures["other_closings"]
    )
    for name, rate in figures["by_the_proposed_recipe"].items():
        low, high = ("not known" if end is None else f"{100 * end:.1f} %" for end in rate["interval"])
        lines.append(
            f"{name} fruit diverted by the proposed recipe: {rate['rejected']} of {rate['decided']} decided "
            f"({rate['marked']} marked), 95 % interval {low} to {high}"
        )
    return lines


def _of(share: dict[str, Any]) -> str:
    low, high = share["interval"]
    return f"{share['count']} of {share['of']} ({100 * low:.1f} to {100 * high:.1f} %)"


def _times(other: dict[str, Any], best: dict[str, Any]) -> str:
    return f"{other['cost'] / best['cost']:.1f} times as much" if best["cost"] else f"{other['cost']:.3f} in place of 0"


def page_of(title: str, best: Proposal, figures: dict[str, Any]) -> str:
    """Make the page with the figures, its two pictures and a slider on the limit, in one file."""
    curve = figures["proposed"]["curve"]
    chosen = min(range(len(curve)), key=lambda place: abs(curve[place]["limit_mm2"] - best.limit_mm2))
    pictures = {"histogram": _histogram(best), "errors": _errors(best, curve)}
    template = templates("station.whatif").get_template("proposal.html.j2")
    return template.render(
        title=title, lines=lines_of(figures), curve=curve, chosen=chosen, report_style=report_style(), **pictures
    )


def _histogram(best: Proposal) -> str:
    """Draw good and bad beside each other, with the limit; returns a data URI."""
    figure = Figure(figsize=(7.2, 3.0), layout="constrained")
    axes = figure.add_subplot()
    groups = [values[np.isfinite(values)] for values in (best.good, best.bad)]
    axes.hist(groups, bins=30, label=["good", "bad"], color=["#5b7f95", "#b3261e"])
    axes.axvline(best.limit_mm2, color="#222222")
    axes.set_xlabel(f"least limit by which the fruit passes, at {best.closing_mm:g} mm of closing [mm²]")
    axes.set_ylabel("fruit")
    axes.legend(frameon=False)
    return data_uri(png(figure))


def _errors(best: Proposal, curve: Sequence[dict[str, Any]]) -> str:
    """Draw both errors over the limit, with their intervals; returns a data URI."""
    figure = Figure(figsize=(7.2, 3.0), layout="constrained")
    axes = figure.add_subplot()
    limits = [point["limit_mm2"] for point in curve]
    for name, label, colour in (("good_diverted", "good diverted", "#5b7f95"), ("bad_passed", "bad passed", "#b3261e")):
        axes.plot(limits, [100 * point[name]["share"] for point in curve], color=colour, label=label)
        low, high = ([100 * point[name]["interval"][end] for point in curve] for end in (0, 1))
        axes.fill_between(limits, low, high, color=colour, alpha=0.15)
    axes.axvline(best.limit_mm2, color="#222222")
    axes.set_xlabel(f"limit at {best.closing_mm:g} mm of closing [mm²]")
    axes.set_ylabel("share of the fruit, with its 95 % interval [%]")
    axes.legend(frameon=False)
    return data_uri(png(figure))

"""Report of a gauge study: one HTML file with its plots inside."""

from station.charts.report import data_uri, templates
from station.studies.gauge import Gauge
from station.studies.gauge_figures import components_plot, measurements_plot
from station.studies.grr import GaugeStudy
from station.studies.report import share

_MEANINGS = {
    "EV": "repeatability (equipment)",
    "AV": "reproducibility (operators)",
    "INT": "operators by parts",
    "GRR": "repeatability and reproducibility",
    "PV": "parts",
    "TV": "total",
}
LEAST_CATEGORIES = 5
GOOD, BEARABLE = 10.0, 30.0
"""Per cent; AIAG calls a gauge acceptable up to the first and unacceptable beyond the second."""


def aiag_class(gauge: Gauge) -> tuple[str, str]:
    """Return AIAG's judgement of such a gauge, as a class of the page's style and as a text."""
    grr = gauge.component("GRR")
    percent, of = (
        (grr.study_percent, "the total variation")
        if grr.tolerance_percent is None
        else (grr.tolerance_percent, "the tolerance")
    )
    judged = "acceptable" if percent <= GOOD else "to be weighed" if percent <= BEARABLE else "not acceptable"
    found = gauge.distinct_categories
    enough = "enough" if found is None or found >= LEAST_CATEGORIES else f"at least {LEAST_CATEGORIES} are required"
    categories = f"{'any number of' if found is None else found} distinct categories ({enough})"
    style = "good" if percent <= GOOD else "" if percent <= BEARABLE else "bad"
    return style, f"GRR is {percent:.1f} % of {of}: {judged}; {categories}."


def render(study: GaugeStudy) -> str:
    """Make an HTML document that needs no network and no other file."""
    gauge = study.gauge
    agreed = study.agreement
    operators = [] if agreed is None else [
        {
            "name": one.operator,
            "repeated": share(one.repeated, one.parts),
            "right": "" if one.right is None else share(one.right, one.parts),
            "kappa": _kappa(one.kappa),
            "misses": "" if one.misses is None or not one.misses[1] else share(*one.misses),
            "false_alarms": "" if one.false_alarms is None or not one.false_alarms[1] else share(*one.false_alarms),
        }
        for one in agreed.operators
    ]  # fmt: skip
    return templates("station.studies").get_template("grr.html.j2").render(
        study=study,
        gauge=gauge,
        meanings=_MEANINGS,
        verdict=aiag_class(gauge),
        operators=operators,
        origins=[(one.name, tolerance_percents(one.gauge)) for one in study.origins],
        between=[] if agreed is None else [(a, b, _kappa(kappa)) for a, b, kappa in agreed.between],
        all_alike="" if agreed is None else share(agreed.all_alike, agreed.parts),
        figures=[
            ("Components of the variation; dashed: 10 and 30 %.", data_uri(components_plot(gauge))),
            ("The measurements.", data_uri(measurements_plot(study.table))),
        ],
    )  # fmt: skip


def tolerance_percents(gauge: Gauge) -> list[float]:
    """Return EV, AV, INT and GRR in per cent of the tolerance that it was analysed with; 0 for a pooled interaction."""
    found = {one.name: one.tolerance_percent or 0.0 for one in gauge.components}
    return [found.get(name, 0.0) for name in ("EV", "AV", "INT", "GRR")]


def _kappa(value: float | None) -> str:
    return "not defined" if value is None else f"{value:.2f}"

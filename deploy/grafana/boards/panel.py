"""Panel definitions and their conversion for Grafana: each with a unit, a description and a link."""

import itertools
import string
from typing import Any, NamedTuple

from grafana_foundation_sdk.builders import (
    common,
    dashboard,
    heatmap,
    prometheus,
    stat,
    table,
    timeseries,
)
from grafana_foundation_sdk.cog.builder import Builder
from grafana_foundation_sdk.cog.variants import Dataquery
from grafana_foundation_sdk.models.common import (
    BigValueGraphMode,
    BigValueTextMode,
    GraphDrawStyle,
    LegendDisplayMode,
    LegendPlacement,
    StackingMode,
    VisibilityMode,
)
from grafana_foundation_sdk.models.dashboard import (
    DashboardLinkType,
    DataSourceRef,
    VariableOption,
    VariableRefresh,
    VariableSort,
)
from grafana_foundation_sdk.models.prometheus import PromQueryFormat

PROMETHEUS = DataSourceRef(type_val="prometheus", uid="prometheus")
POSTGRESQL = DataSourceRef(type_val="grafana-postgresql-datasource", uid="postgresql")
DOCS = "${docs}"
"""The variable with the documents' address."""
HEIGHT = 8


class Prom(NamedTuple):
    """A Prometheus query."""

    expr: str
    legend: str = ""
    """With the labels in double braces; empty for Grafana's own."""


class Sql(NamedTuple):
    """A PostgreSQL query."""

    sql: str


class Panel(NamedTuple):
    """One panel of a dashboard."""

    kind: str
    """`lines`, `stacked`, `bars`, `number`, `heat` or `table`."""
    title: str
    unit: str
    """Grafana's id of it."""
    about: str
    """Its content, and what to do about a bad value."""
    link: str
    """The alarm's or the subject's document, below `docs/`."""
    queries: tuple[Prom, ...] | tuple[Sql, ...]
    width: int = 8
    largest: float | None = None
    """Of the axis, where it is known."""


def prom(
    kind: str, title: str, unit: str, about: str, link: str, *queries: tuple[str, str] | str, **more: Any
) -> Panel:
    """Make a panel with Prometheus queries, alone or with their legend; `more` are other fields of `Panel`."""
    questions = tuple(Prom(ask) if isinstance(ask, str) else Prom(*ask) for ask in queries)
    return Panel(kind, title, unit, about, link, questions, **more)


def sql(kind: str, title: str, unit: str, about: str, link: str, ask: str, **more: Any) -> Panel:
    """Make a panel with a PostgreSQL query.

    Args:
        ask: the statement; the first column of a time series is `time`.
        more: other fields of `Panel`.
    """
    return Panel(kind, title, unit, about, link, (Sql(" ".join(ask.split())),), **more)


class _SqlQuery(Dataquery, Builder[Dataquery]):
    """PostgreSQL query as Grafana 11 writes it, and its own builder; the SDK has no model of it."""

    def __init__(self, ref_id: str, text: str, *, over_time: bool) -> None:
        self._ref_id, self._text, self._over_time = ref_id, text, over_time

    def build(self) -> Dataquery:
        return self

    def to_json(self) -> dict[str, object]:
        return {
            "refId": self._ref_id,
            "datasource": POSTGRESQL,
            "editorMode": "code",
            "rawQuery": True,
            "rawSql": self._text,
            "format": "time_series" if self._over_time else "table",
        }


def built(panel: Panel, number: int) -> Any:
    """Return the panel for Grafana, by a number that is unique on the dashboard."""
    making = _MAKERS[panel.kind](panel)
    source = PROMETHEUS if isinstance(panel.queries[0], Prom) else POSTGRESQL
    link = dashboard.DashboardLink("What to do").type(DashboardLinkType.LINK).url(f"{DOCS}/{panel.link}")
    making = (
        making.id(number).title(panel.title).description(panel.about).unit(panel.unit).datasource(source)
        .links([link.target_blank(target_blank=True)]).span(panel.width).height(4 if panel.kind == "number" else HEIGHT)
    )  # fmt: skip
    for letter, ask in zip(string.ascii_uppercase, panel.queries, strict=False):
        making = making.with_target(_with_query(panel, letter, ask))
    return making


def board(uid: str, title: str, about: str, variables: tuple[Any, ...], rows: dict[str, tuple[Panel, ...]]) -> Any:
    """Make a dashboard.

    Args:
        uid: permanent identity for links and bookmarks.
        about: the question that it answers.
        variables: the reader's selections.
        rows: panels under their headings.
    """
    docs = dashboard.TextBoxVariable("docs").label("Documents").default_value("/docs").description(
        "Address of the station's documents, the target of links."
    )  # fmt: skip
    others = dashboard.DashboardLink("Dashboards").type(DashboardLinkType.DASHBOARDS).tags(["fruit-station"])
    making = (
        dashboard.Dashboard(title).uid(uid).description(about).tags(["fruit-station"]).readonly()
        .timezone("browser").time("now-12h", "now").refresh("30s")
        .link(others.as_dropdown(as_dropdown=True).include_vars(include_vars=True).keep_time(keep_time=True))
    )  # fmt: skip
    numbers = itertools.count(1)
    for variable in (*variables, docs):
        making = making.with_variable(variable)
    for heading, panels in rows.items():
        making = making.with_row(dashboard.Row(heading))
        for panel in panels:
            making = making.with_panel(built(panel, next(numbers)))
    return making


STATIONS = 'label_values(up{job="station"}, station)'
"""Query of the stations that Prometheus knows, also of one that is off for as long as the dashboard goes back."""


def chosen(name: str, label: str, query: str, *, several: bool) -> Any:
    """Make a variable that a reader selects from existing values.

    Args:
        name: in expressions.
        label: for people.
        query: `label_values(…)` for Prometheus, a SELECT for PostgreSQL.
        several: whether all or some may be selected; else one.
    """
    source = POSTGRESQL if query.upper().startswith("SELECT") else PROMETHEUS
    making = (
        dashboard.QueryVariable(name).label(label).query(query).datasource(source)
        .refresh(VariableRefresh.ON_TIME_RANGE_CHANGED).sort(VariableSort.ALPHABETICAL_ASC)
        .multi(several).include_all(several)
    )  # fmt: skip
    return making.current(VariableOption(selected=True, text="All", value="$__all")) if several else making


def _with_query(panel: Panel, letter: str, ask: Prom | Sql) -> Builder[Any]:
    if isinstance(ask, Sql):
        return _SqlQuery(letter, ask.sql, over_time=panel.kind not in {"table", "number"})
    query = prometheus.Dataquery().expr(ask.expr).ref_id(letter).datasource(PROMETHEUS)
    if panel.kind == "heat":
        return query.range().format(PromQueryFormat.HEATMAP).legend_format("{{le}}")
    if panel.kind in {"table", "number"}:
        query = query.instant().format(PromQueryFormat.TABLE if panel.kind == "table" else PromQueryFormat.TIME_SERIES)
    else:
        query = query.range()
    return query.legend_format(ask.legend) if ask.legend else query


def _lines(panel: Panel) -> Any:
    legend = common.VizLegendOptions().display_mode(LegendDisplayMode.LIST).placement(LegendPlacement.BOTTOM)
    making = (
        timeseries.Panel()
        .min(0)
        .line_width(1)
        .show_points(VisibilityMode.AUTO)
        .legend(legend.show_legend(show_legend=True))
    )
    if panel.kind in {"stacked", "bars"}:
        making = making.stacking(common.StackingConfig().mode(StackingMode.NORMAL)).fill_opacity(60)
    if panel.kind == "bars":
        making = making.draw_style(GraphDrawStyle.BARS)
    return making if panel.largest is None else making.max(panel.largest)


def _number(_panel: Panel) -> Any:
    reduce = common.ReduceDataOptions().calcs(["lastNotNull"])
    return stat.Panel().graph_mode(BigValueGraphMode.NONE).text_mode(BigValueTextMode.VALUE_AND_NAME).reduce_options(
        reduce
    )  # fmt: skip


def _heat(panel: Panel) -> Any:
    return heatmap.Panel().calculate(calculate=False).y_axis(heatmap.YAxisConfig().unit(panel.unit))


def _table(_panel: Panel) -> Any:
    return table.Panel().filterable(filterable=True)


_MAKERS = {"lines": _lines, "stacked": _lines, "bars": _lines, "number": _number, "heat": _heat, "table": _table}

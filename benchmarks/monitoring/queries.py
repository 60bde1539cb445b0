"""Every query of dashboards and rules, with the variables filled in as Grafana does."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from .prometheus import recordings, shipped_alerts

DASHBOARDS = Path(__file__).resolve().parents[2] / "deploy" / "grafana" / "dashboards"
_COMPARED = re.compile(r"(?<![=!<>~])(==|!=|>=|<=|>|<)(?![=~])\s*(?!bool)")
_QUOTED = re.compile(r'"[^"]*"|\{[^}]*\}')


class Panel(NamedTuple):
    """One of a dashboard's, as its file has it."""

    board: str
    title: str
    data: dict[str, Any]

    @property
    def targets(self) -> list[dict[str, Any]]:
        """Queries of the panel, as its file has them."""
        return self.data["targets"]


def dashboards() -> dict[str, dict[str, Any]]:
    """The committed dashboards by the names of their files."""
    return {file.stem: json.loads(file.read_text(encoding="utf-8")) for file in sorted(DASHBOARDS.glob("*.json"))}


def panels() -> list[Panel]:
    """All panels of all dashboards, without the rows."""
    return [
        Panel(name, panel["title"], panel)
        for name, board in dashboards().items()
        for panel in board["panels"]
        if panel["type"] != "row"
    ]


def promql(expr: str, station: str, rate_interval: str, week: str = "1w") -> str:
    """A dashboard's expression as Grafana sends it.

    Args:
        expr: with variables.
        station: the chosen one.
        rate_interval: what `$__rate_interval` is at that scale.
        week: how long a week is, where history is shorter.
    """
    filled = expr.replace("$__rate_interval", rate_interval).replace("offset 1w", f"offset {week}")
    return filled.replace("$station", station).replace("$fruit", ".+")


def sql(text: str, begin: str, end: str, zone: str = "UTC", **variables: list[str]) -> str:
    """A dashboard's statement as Grafana sends it.

    Args:
        text: with macros and variables.
        begin: from when, ISO 8601.
        end: until when.
        zone: the reader's time zone.
        variables: the chosen values of each.
    """
    filled = re.sub(r"\$__timeFilter\((\w+)\)", rf"\1 BETWEEN '{begin}' AND '{end}'", text)
    filled = filled.replace("$__timeFrom()", f"'{begin}'").replace("$__timeTo()", f"'{end}'")
    filled = filled.replace("$__timezone", zone)
    for name, values in variables.items():
        quoted = ",".join("'" + value.replace("'", "''") + "'" for value in values)
        filled = filled.replace(f"${{{name}:sqlstring}}", quoted)
    return filled


def unfiltered(expr: str) -> str:
    """An alert's expression, so that it answers also where nothing is wrong: comparisons return 0 or 1.

    Args:
        expr: PromQL without strings or braces beside those of selectors.
    """
    quoted: list[str] = []

    def keep(match: re.Match[str]) -> str:
        quoted.append(match[0])
        return f"\x00{len(quoted) - 1}\x00"

    compared = _COMPARED.sub(r"\1 bool ", _QUOTED.sub(keep, expr))
    queries = re.sub("\x00(\\d+)\x00", lambda match: quoted[int(match[1])], compared)
    return re.sub(r"^absent\((.*)\)$", r"\1", queries)


def rules() -> Iterator[tuple[str, str]]:
    """Every rule's name and expression; an alert's in the form that answers also where nothing is wrong."""
    yield from recordings().items()
    for name, rule in shipped_alerts().items():
        yield name, unfiltered(rule["expr"])


def used(names: set[str]) -> set[str]:
    """Return those of some metrics that a rule or a dashboard queries.

    Args:
        names: as they are scraped, with a histogram's `_bucket`, `_sum` or `_count`.
    """
    queries = " ".join(
        [*(expr for _, expr in rules()), *(t.get("expr", "") for panel in panels() for t in panel.targets)]
    )
    words = set(re.findall(r"[a-zA-Z_:][a-zA-Z0-9_:]*", queries))
    return names & words

# ruff: noqa: S608 (constants put together; what Grafana puts in is quoted by it)
"""Dashboard of lots, growers and trends, from the records of all stations in PostgreSQL; for quality management."""

from typing import Any

from deploy.grafana.boards.panel import Panel, board, chosen, sql

BETWEEN = "hour BETWEEN date_trunc('hour', $__timeFrom()::timestamptz, 'UTC') AND $__timeTo()::timestamptz"
CHOSEN = "station IN (${station:sqlstring}) AND fruit IN (${fruit:sqlstring}) AND inspections > 0"
HERE = f"{BETWEEN} AND {CHOSEN}"
ALL = "sum(inspections)"
DAY = "date_trunc('day', hour, '$__timezone')"
"""The reader's day: in the time zone in which Grafana shows it, independent of the database's."""
FAILED = (
    "coalesce(sum(inspections) FILTER (WHERE outcome = 'FAIL'), 0)::float "
    "/ nullif(sum(inspections) FILTER (WHERE outcome <> 'NO_RESULT'), 0)"
)
UNJUDGED = f"coalesce(sum(inspections) FILTER (WHERE outcome = 'NO_RESULT'), 0)::float / {ALL}"
GROWER = "coalesce(nullif(grower, ''), 'not known')"
LOT = "coalesce(nullif(lot, ''), 'not known')"


def median(quantity: str, metric: str, unit: float, name: str) -> str:
    """Return a statement for the median by hour, interpolated in its bin of the summary, right to 2.5 %.

    Args:
        quantity: as `hourly_values` has it.
        metric: column by which it is apart.
        unit: of the quantity, in that of the panel.
        name: of the value's column.
    """
    return f"""WITH binned AS (
        SELECT hour, {metric}, bin, {ALL} AS here FROM hourly_values
        WHERE quantity = '{quantity}' AND {HERE} GROUP BY 1, 2, 3
        ), ranked AS (
        SELECT *, sum(here) OVER (PARTITION BY hour, {metric} ORDER BY bin) AS up_to,
        sum(here) OVER (PARTITION BY hour, {metric}) / 2 AS half FROM binned
        )
        SELECT hour AS time, {metric} AS metric,
        power(1.05::float8, bin + (half - up_to + here) / here) * {unit} AS {name}
        FROM ranked WHERE up_to - here < half AND up_to >= half ORDER BY 1"""


LOTS = (
    sql("table", "Lots", "percentunit",
        "Each lot of the range, whole: also its fruit before and after the range; the newest on top. Fruit without a "
        "lot is counted in the range. *Failed* is a share of the judged fruit, *not judged* of all fruit. The lot's "
        "report is at the station: `station records report NAME lot.html`.",
        "records.md",
        f"""SELECT {LOT} AS lot, {GROWER} AS grower, fruit, station, min(first_began) AS began,
        {ALL}::text AS inspected, {FAILED} AS failed, {UNJUDGED} AS "not judged"
        FROM hourly_outcomes_of_growers WHERE {CHOSEN} AND (lot <> '' OR {BETWEEN})
        AND (station, lot) IN (SELECT station, lot FROM hourly_outcomes WHERE {HERE})
        GROUP BY 1, 2, fruit, station ORDER BY min(first_began) DESC LIMIT 200""", width=24),
)  # fmt: skip
GROWERS = (
    sql("table", "Growers", "percentunit",
        "Who brings what, worst first. *Failed* is a share of the judged fruit.", "records.md",
        f"""SELECT {GROWER} AS grower, fruit, {ALL}::text AS inspected, {FAILED} AS failed
        FROM hourly_outcomes_of_growers WHERE {HERE}
        GROUP BY 1, fruit ORDER BY 4 DESC NULLS LAST""", width=12),
    sql("lines", "Failed by grower and day", "percentunit", "Share of the judged fruit.", "alarms.md#reject-rate",
        f"""SELECT {DAY} AS time, {GROWER} AS metric, {FAILED} AS failed
        FROM hourly_outcomes_of_growers WHERE {HERE} GROUP BY 1, 2 ORDER BY 1""", width=12),
)  # fmt: skip
TRENDS = (
    sql("bars", "Outcomes by day", "short", "How many fruit.", "records.md",
        f"""SELECT {DAY} AS time, outcome AS metric, {ALL}::bigint AS fruit
        FROM hourly_outcomes WHERE {HERE} GROUP BY 1, 2 ORDER BY 1"""),
    sql("lines", "Failed by fruit and hour", "percentunit", "Share of the judged fruit.", "alarms.md#reject-rate",
        f"""SELECT hour AS time, fruit AS metric, {FAILED} AS failed
        FROM hourly_outcomes WHERE {HERE} GROUP BY 1, 2 ORDER BY 1"""),
    sql("lines", "Contact area by hour", "suffix: mm²",
        "Median of the deciding area: a fruit that becomes softer with the season, or a gel that does.",
        "measurement.md", median("area_mm2", "fruit", 1.0, "area")),
    sql("table", "Reasons", "short", "Why fruit was diverted; a fruit can have several.", "alarms.md#many-no-result",
        f"""SELECT reason, fruit, outcome, {ALL}::bigint AS fruits
        FROM hourly_reasons WHERE {HERE} GROUP BY 1, 2, 3 ORDER BY 4 DESC"""),
    sql("lines", "Inspections by hour", "s", "Median duration, to see when the line waits for the station.",
        "cycle-time.md", median("duration_ms", "station", 0.001, "seconds")),
    sql("table", "Recipes in use", "short", "By name and revision, with how many fruit.", "recipes.md",
        f"""SELECT recipes.name, recipes.revision, left(recipes.sha256, 12) AS content, {ALL}::bigint AS fruits
        FROM hourly_outcomes JOIN recipes ON recipes.sha256 = hourly_outcomes.recipe_sha256 WHERE {HERE}
        GROUP BY 1, 2, 3 ORDER BY 4 DESC"""),
)  # fmt: skip
REPLICATION = (
    sql("table", "Replication of each station", "short",
        "An old time is a station whose outbox does not reach this database.", "alarms.md#outbox-behind",
        "SELECT station, max(told) AS told, sum(last_entry) AS entries FROM stations "
        "WHERE station IN (${station:sqlstring}) GROUP BY station ORDER BY 2"),
    sql("number", "Refused", "short", "Rows that this database could not take as they were: read the table `refused`.",
        "outbox.md", "SELECT count(*) AS refused FROM refused WHERE station IN (${station:sqlstring})"),
    sql("table", "Audit trail", "none",
        "The last commands and changes, by people, PLC and station; without the seals of inspections.", "audit.md",
        "SELECT at, station, who, action, subject, reason FROM audit WHERE $__timeFilter(at) "
        "AND action <> 'inspection.sealed' AND station IN (${station:sqlstring}) ORDER BY at DESC LIMIT 100"),
)  # fmt: skip


def dashboard() -> Any:
    """Return the dashboard."""
    variables = (
        chosen("station", "Station", "SELECT DISTINCT station FROM stations ORDER BY 1", several=True),
        chosen("fruit", "Fruit", "SELECT DISTINCT fruit FROM hourly_outcomes WHERE fruit <> '' ORDER BY 1",
               several=True),
    )  # fmt: skip
    about = "Whose fruit is good, and what changes over the season?"
    rows: dict[str, tuple[Panel, ...]] = {
        "Lots": LOTS,
        "Growers": GROWERS,
        "Trends": TRENDS,
        "The stations' records": REPLICATION,
    }
    return board("fruit-quality", "Quality", about, variables, rows)

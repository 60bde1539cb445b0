# ruff: noqa: S608 (constants put together; what Grafana puts in is quoted by it)
"""Dashboard of lots, growers and trends, from the records of all stations in PostgreSQL; for quality management."""

from typing import Any

from deploy.grafana.boards.panel import board, chosen, sql

HERE = "$__timeFilter(began) AND station IN (${station:sqlstring}) AND fruit IN (${fruit:sqlstring})"
FAILED = "count(*) FILTER (WHERE outcome = 'FAIL')::float / nullif(count(*) FILTER (WHERE outcome <> 'NO_RESULT'), 0)"
UNJUDGED = "count(*) FILTER (WHERE outcome = 'NO_RESULT')::float / count(*)"
GROWER = "coalesce(nullif(grower, ''), 'not told')"
LOT = "coalesce(nullif(lot, ''), 'not told')"

LOTS = (
    sql("table", "Lots", "percentunit",
        "Each lot with its grower and what became of it; the newest on top. The lot's report is at the "
        "station: `station records report NAME lot.html`.", "records.md",
        f"""SELECT {LOT} AS lot, {GROWER} AS grower, fruit, station, min(began) AS began, count(*)::text AS inspected,
        {FAILED} AS failed, {UNJUDGED} AS "not judged"
        FROM inspections_of_growers WHERE {HERE}
        GROUP BY 1, 2, fruit, station ORDER BY min(began) DESC LIMIT 200""", width=24),
)  # fmt: skip
GROWERS = (
    sql("table", "Growers", "percentunit", "Who brings what, worst first.", "records.md",
        f"""SELECT {GROWER} AS grower, fruit, count(*)::text AS inspected, {FAILED} AS failed
        FROM inspections_of_growers WHERE {HERE}
        GROUP BY 1, fruit ORDER BY 4 DESC NULLS LAST""", width=12),
    sql("bars", "Failed by grower and day", "percentunit", "Share of the judged fruit.", "alarms.md#reject-rate",
        f"""SELECT date_trunc('day', began) AS time, {GROWER} AS metric, {FAILED} AS failed
        FROM inspections_of_growers WHERE {HERE} GROUP BY 1, 2 ORDER BY 1""", width=12),
)  # fmt: skip
TRENDS = (
    sql("bars", "Outcomes by day", "short", "How many fruit.", "records.md",
        f"""SELECT date_trunc('day', began) AS time, outcome AS metric, count(*) AS fruit
        FROM inspections WHERE {HERE} GROUP BY 1, 2 ORDER BY 1"""),
    sql("lines", "Failed by fruit and hour", "percentunit", "Share of the judged fruit.", "alarms.md#reject-rate",
        f"""SELECT date_trunc('hour', began) AS time, fruit AS metric, {FAILED} AS failed
        FROM inspections WHERE {HERE} GROUP BY 1, 2 ORDER BY 1"""),
    sql("lines", "Contact area by hour", "suffix: mm²",
        "Median of the deciding area: a fruit that becomes softer with the season, or a gel that does.",
        "measurement.md",
        f"""SELECT date_trunc('hour', began) AS time, fruit AS metric,
        percentile_cont(0.5) WITHIN GROUP (ORDER BY area_mm2) AS area
        FROM inspections WHERE {HERE} AND area_mm2 IS NOT NULL GROUP BY 1, 2 ORDER BY 1"""),
    sql("table", "Reasons", "short", "Why fruit was diverted; a fruit can have several.", "alarms.md#many-no-result",
        f"""SELECT reason, fruit, outcome, count(*) AS fruits
        FROM inspections, unnest(reasons) AS reason WHERE {HERE} GROUP BY 1, 2, 3 ORDER BY 4 DESC"""),
    sql("lines", "Inspections by hour", "s", "Median duration, to see when the line waits for the station.",
        "cycle-time.md",
        f"""SELECT date_trunc('hour', began) AS time, station AS metric,
        percentile_cont(0.5) WITHIN GROUP (ORDER BY duration_ms) / 1000.0 AS seconds
        FROM inspections WHERE {HERE} AND duration_ms IS NOT NULL GROUP BY 1, 2 ORDER BY 1"""),
    sql("table", "Recipes in use", "short", "By name and revision, with how many fruit.", "recipes.md",
        f"""SELECT recipes.name, recipes.revision, left(recipes.sha256, 12) AS content, count(*) AS fruits
        FROM inspections JOIN recipes ON recipes.sha256 = inspections.recipe_sha256 WHERE {HERE}
        GROUP BY 1, 2, 3 ORDER BY 4 DESC"""),
)  # fmt: skip
REPLICATION = (
    sql("table", "Replication of each station", "short",
        "An old time is a station whose outbox does not reach this database.", "alarms.md#outbox-behind",
        "SELECT station, max(told) AS told, sum(last_entry) AS entries FROM stations "
        "WHERE station IN (${station:sqlstring}) GROUP BY station ORDER BY 2"),
    sql("number", "Refused", "short", "Rows that this database could not take as they were: read the table `refused`.",
        "outbox.md", "SELECT count(*) AS refused FROM refused WHERE station IN (${station:sqlstring})"),
    sql("table", "Audit trail", "none", "The last changes that people made.", "audit.md",
        "SELECT at, station, who, action, subject, reason FROM audit "
        "WHERE $__timeFilter(at) AND station IN (${station:sqlstring}) ORDER BY at DESC LIMIT 100"),
)  # fmt: skip


def dashboard() -> Any:
    """The dashboard."""
    variables = (
        chosen("station", "Station", "SELECT DISTINCT station FROM stations ORDER BY 1", several=True),
        chosen("fruit", "Fruit", "SELECT DISTINCT fruit FROM inspections WHERE fruit IS NOT NULL ORDER BY 1",
               several=True),
    )  # fmt: skip
    about = "Whose fruit is good, and what changes over the season?"
    rows = {"Lots": LOTS, "Growers": GROWERS, "Trends": TRENDS, "The stations' records": REPLICATION}
    return board("fruit-quality", "Quality", about, variables, rows)

"""The peer of the summaries by hour: the same questions of the dashboard Quality, put to the inspections themselves."""

CHOSEN = "station IN (${station:sqlstring}) AND fruit IN (${fruit:sqlstring})"
HERE = f"$__timeFilter(began) AND {CHOSEN}"
DAY = "date_trunc('day', began, '$__timezone')"
FAILED = "count(*) FILTER (WHERE outcome = 'FAIL')::float / nullif(count(*) FILTER (WHERE outcome <> 'NO_RESULT'), 0)"
UNJUDGED = "count(*) FILTER (WHERE outcome = 'NO_RESULT')::float / count(*)"
GROWER = "coalesce(nullif(grower, ''), 'not known')"
LOT = "coalesce(nullif(lot, ''), 'not known')"

STATEMENTS = {
    "Lots": f"""SELECT {LOT} AS lot, {GROWER} AS grower, fruit, station, min(began) AS began,
        count(*)::text AS inspected, {FAILED} AS failed, {UNJUDGED} AS "not judged"
        FROM inspections_of_growers WHERE {CHOSEN} AND (lot <> '' OR $__timeFilter(began))
        AND (station, lot) IN (SELECT station, lot FROM inspections WHERE {HERE})
        GROUP BY 1, 2, fruit, station ORDER BY min(began) DESC LIMIT 200""",
    "Growers": f"""SELECT {GROWER} AS grower, fruit, count(*)::text AS inspected, {FAILED} AS failed
        FROM inspections_of_growers WHERE {HERE}
        GROUP BY 1, fruit ORDER BY 4 DESC NULLS LAST""",
    "Failed by grower and day": f"""SELECT {DAY} AS time, {GROWER} AS metric, {FAILED} AS failed
        FROM inspections_of_growers WHERE {HERE} GROUP BY 1, 2 ORDER BY 1""",
    "Outcomes by day": f"""SELECT {DAY} AS time, outcome AS metric, count(*) AS fruit
        FROM inspections WHERE {HERE} GROUP BY 1, 2 ORDER BY 1""",
    "Failed by fruit and hour": f"""SELECT date_trunc('hour', began) AS time, fruit AS metric, {FAILED} AS failed
        FROM inspections WHERE {HERE} GROUP BY 1, 2 ORDER BY 1""",
    "Contact area by hour": f"""SELECT date_trunc('hour', began) AS time, fruit AS metric,
        percentile_cont(0.5) WITHIN GROUP (ORDER BY area_mm2) AS area
        FROM inspections WHERE {HERE} AND area_mm2 IS NOT NULL GROUP BY 1, 2 ORDER BY 1""",
    "Reasons": f"""SELECT reason, fruit, outcome, count(*) AS fruits
        FROM inspections, unnest(reasons) AS reason WHERE {HERE} GROUP BY 1, 2, 3 ORDER BY 4 DESC""",
    "Inspections by hour": f"""SELECT date_trunc('hour', began) AS time, station AS metric,
        percentile_cont(0.5) WITHIN GROUP (ORDER BY duration_ms) / 1000.0 AS seconds
        FROM inspections WHERE {HERE} AND duration_ms IS NOT NULL GROUP BY 1, 2 ORDER BY 1""",
    "Recipes in use": f"""SELECT recipes.name, recipes.revision, left(recipes.sha256, 12) AS content,
        count(*) AS fruits
        FROM inspections JOIN recipes ON recipes.sha256 = inspections.recipe_sha256 WHERE {HERE}
        GROUP BY 1, 2, 3 ORDER BY 4 DESC""",
    "fruit (variable)": "SELECT DISTINCT fruit FROM inspections WHERE fruit IS NOT NULL ORDER BY 1",
}
"""By the panel's title."""
MEDIANS = {"Contact area by hour", "Inspections by hour"}
"""What the summaries know to a bin's half, 2.5 %; all else is a count and exact."""
MEDIAN_TOLERANCE = 0.025

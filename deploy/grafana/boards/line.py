"""Dashboard of the line: rejects, throughput, areas; for the person responsible for a shift."""

from typing import Any

from deploy.grafana.boards.panel import STATIONS, board, chosen, prom

HERE = 'station=~"$station", fruit=~"$fruit"'
DIVERTED = f'{HERE}, outcome!="PASS"'
REJECTS, UNJUDGED, LATE = "alarms.md#reject-rate", "alarms.md#many-no-result", "alarms.md#deadline-missed"

NOW = (
    prom(
        "number", "Reject rate, last hour", "percentunit",
        "Share of the judged fruit that failed. The alert RejectRateHigh reports an unusual share.",
        REJECTS, (f"station_fruit:reject_ratio:1h{{{HERE}}}", "{{fruit}}"), width=6,
    ),
    prom(
        "number", "Not judged, last hour", "percentunit",
        "Share of all fruit without a result, for reasons that no alert of the sensor names.",
        UNJUDGED, (f"station_fruit:unjudged_ratio:1h{{{HERE}}}", "{{fruit}}"), width=6,
    ),
    prom(
        "number", "Fruit a minute", "short",
        "Over the last quarter of an hour, whatever the outcome.",
        "cycle-time.md", (f"60 * sum by (fruit) (station_fruit_outcome:inspections:rate15m{{{HERE}}})", "{{fruit}}"),
        width=6,
    ),
    prom(
        "number", "Ready", "bool_yes_no",
        "Whether a trigger would be accepted; /readyz says why not.",
        "metrics.md", ('station_ready{station=~"$station"}', "{{station}}"), width=6,
    ),
)  # fmt: skip
RATES = (
    prom(
        "lines", "Reject rate and its band", "percentunit",
        "Share of the judged fruit that failed, over one hour, with the last seven days and what chance allows on top "
        "of them. Above the band look at rejected fruit: the lot is bad, or the measurement is.",
        REJECTS,
        (f"station_fruit:reject_ratio:1h{{{HERE}}}", "{{fruit}}"),
        (f"station_fruit:reject_ratio:7d{{{HERE}}}", "{{fruit}}, seven days"),
        (f"station_fruit:reject_ratio:highest{{{HERE}}}", "{{fruit}}, highest"),
        width=16,
    ),
    prom(
        "lines", "Failures seen and expected, six hours", "short",
        "Far fewer than expected means that damage is no longer seen: the alert RejectRateLow.",
        REJECTS,
        (f"station_fruit:rejects:increase6h{{{HERE}}}", "{{fruit}}, seen"),
        (f"station_fruit:rejects_expected:increase6h{{{HERE}}}", "{{fruit}}, expected"),
    ),
    prom(
        "stacked", "Why fruit is diverted", "short",
        "Fruit a minute that failed or could not be judged, by the first reason.",
        UNJUDGED,
        (f"60 * sum by (reason) (rate(station_inspections_total{{{DIVERTED}}}[$__rate_interval]))", "{{reason}}"),
    ),
    prom(
        "lines", "Pressed once more", "short",
        "Fruit a minute that one press did not decide; each takes a press more.",
        UNJUDGED,
        (f"60 * sum by (fruit) (rate(station_second_presses_total{{{HERE}}}[$__rate_interval]))", "{{fruit}}"),
    ),
    prom(
        "lines", "Not judged and its band", "percentunit",
        "Share of all fruit without a result, over one hour, with the last seven days and what chance allows on top "
        "of them.",
        UNJUDGED,
        (f"station_fruit:unjudged_ratio:1h{{{HERE}}}", "{{fruit}}"),
        (f"station_fruit:unjudged_ratio:7d{{{HERE}}}", "{{fruit}}, seven days"),
        (f"station_fruit:unjudged_ratio:highest{{{HERE}}}", "{{fruit}}, highest"),
    ),
    prom(
        "lines", "Reject rate, today against last week", "percentunit",
        "Share of the judged fruit that failed; beside it the same hour of the same weekday, one week ago.",
        REJECTS,
        (f"station_fruit:reject_ratio:1h{{{HERE}}}", "{{fruit}}"),
        (f"station_fruit:reject_ratio:1h{{{HERE}}} offset 1w", "{{fruit}}, last week"),
    ),
)  # fmt: skip
FRUIT = (
    prom(
        "stacked", "Throughput", "short", "Fruit a minute by outcome.", "cycle-time.md",
        (f"60 * sum by (outcome) (station_fruit_outcome:inspections:rate15m{{{HERE}}})", "{{outcome}}"),
    ),
    prom(
        "lines", "Throughput, today against last week", "short", "Fruit a minute, all outcomes.", "cycle-time.md",
        (f"60 * sum(station_fruit_outcome:inspections:rate15m{{{HERE}}})", "today"),
        (f"60 * sum(station_fruit_outcome:inspections:rate15m{{{HERE}}} offset 1w)", "last week"),
    ),
    prom(
        "lines", "Late, and triggers refused", "short",
        "In the last hour. Late fruit is NO_RESULT; a refused trigger is a fruit without an inspection.", LATE,
        (f"sum by (fruit) (increase(station_inspections_late_total{{{HERE}}}[1h]))", "{{fruit}}, late"),
        ('sum by (reason) (increase(station_triggers_refused_total{station=~"$station"}[1h]))', "refused: {{reason}}"),
    ),
    prom(
        "heat", "Contact area over time", "suffix: mm²",
        "How many fruit had which deciding area. A band that wanders without the fruit having changed is the gel's or "
        "the light's, not the fruit's.",
        "measurement.md",
        f"sum by (le) (increase(station_contact_area_mm2_bucket{{{HERE}}}[$__rate_interval]))",
        width=16,
    ),
    prom(
        "lines", "Closing that decided", "lengthmm", "Median of the closing at which the area decided.",
        "measurement.md",
        (f"histogram_quantile(0.5, sum by (fruit, le) (rate(station_closing_mm_bucket{{{HERE}}}[1h])))", "{{fruit}}"),
    ),
)  # fmt: skip


def dashboard() -> Any:
    """Return the dashboard."""
    return board(
        "fruit-line", "Line", "How much is rejected, why, and is that usual?",
        (
            chosen("station", "Station", STATIONS, several=True),
            chosen("fruit", "Fruit", "label_values(station_inspections_total, fruit)", several=True),
        ),
        {"Now": NOW, "Rejects": RATES, "Fruit": FRUIT},
    )  # fmt: skip

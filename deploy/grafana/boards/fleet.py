"""Dashboard of all stations side by side, for maintenance planning."""

from typing import Any

from deploy.grafana.boards.panel import STATIONS, board, chosen, prom

HERE = 'station=~"$station"'
UP = f'up{{job="station", {HERE}}}'
ROWS = (
    prom("number", "Stations that answer", "short", "Of those that Prometheus knows.", "reliability.md",
         (f"sum({UP})", "answer"), (f"count({UP})", "known"), width=6),
    prom("number", "Ready", "short", "How many would accept a trigger.", "metrics.md",
         (f"sum(station_ready{{{HERE}}})", "ready"), width=6),
    prom("number", "Alarms", "short", "Active alarms, by priority.", "alarms.md",
         (f"sum by (priority) (station_alarms_active{{{HERE}}})", "{{priority}}"), width=6),
    prom("number", "Fruit a minute", "short", "Sum over all stations.", "cycle-time.md",
         (f"60 * sum(station:inspections:rate15m{{{HERE}}})", "fruit"), width=6),
)  # fmt: skip
COMPARED = (
    prom("lines", "Answers", "bool_yes_no", "0 is a machine that is off, or a network that is cut.", "reliability.md",
         (UP, "{{station}}"), largest=1),
    prom("lines", "Alarms", "short", "Active alarms.", "alarms.md",
         (f"sum by (station) (station_priority:alarms_active:sum{{{HERE}}})", "{{station}}")),
    prom("lines", "Throughput", "short", "Fruit a minute.", "cycle-time.md",
         (f"60 * station:inspections:rate15m{{{HERE}}}", "{{station}}")),
    prom("lines", "Reject rate", "percentunit",
         "Share of the judged fruit that failed, over one hour. One station that differs from the others on the same "
         "fruit measures differently: verify it.", "alarms.md#reject-rate",
         (f"station_fruit:reject_ratio:1h{{{HERE}}}", "{{station}}, {{fruit}}")),
    prom("lines", "Not judged", "percentunit",
         "Share of all fruit without a result, over one hour, for reasons that no alert of the sensor names.",
         "alarms.md#many-no-result",
         (f"station_fruit:unjudged_ratio:1h{{{HERE}}}", "{{station}}, {{fruit}}")),
    prom("lines", "Share of the deadline", "percentunit", "Of the slowest twentieth.", "alarms.md#deadline-missed",
         (f"station_fruit:cycle_share:p95_15m{{{HERE}}}", "{{station}}, {{fruit}}")),
    prom("lines", "Drift of the reference", "suffix: grey levels", "The sensor with the largest drift is changed next.",
         "alarms.md#reference-drifting", (f"station_reference_drift_grey_levels{{{HERE}}}", "{{station}}")),
    prom("lines", "Free space", "bytes", "On the records' disks.", "alarms.md#disk-low",
         (f"station_records_free_bytes{{{HERE}}}", "{{station}}")),
    prom("lines", "Behind by", "s", "Age of the oldest record that is not delivered to another system.",
         "alarms.md#outbox-behind", (f"station_outbox_lag_seconds{{{HERE}}}", "{{station}}, {{destination}}")),
    prom("table", "Calibrations", "s", "Their ages: the oldest is calibrated next.", "alarms.md#calibration-old",
         f"sort_desc(max by (station) (station_calibration_age_seconds{{{HERE}}}))", width=12),
    prom("table", "Versions", "none", "What runs where.", "metrics.md",
         f"max by (station, version, python) (station_build_info{{{HERE}}})", width=12),
)  # fmt: skip


def dashboard() -> Any:
    """Return the dashboard."""
    station = chosen("station", "Stations", STATIONS, several=True)
    about = "Which station needs attention?"
    return board("fruit-fleet", "Fleet", about, (station,), {"Now": ROWS, "Side by side": COMPARED})

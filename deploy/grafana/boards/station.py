"""Dashboard of one station's health, for troubleshooting."""

from typing import Any

from deploy.grafana.boards.panel import STATIONS, board, chosen, prom

HERE = 'station="$station"'
LASTED = "station_inspection_duration_seconds"


def mean_of(phases: str) -> str:
    """Return an expression: seconds in the phases of the cycle that a regular expression names, per inspection."""
    took = f'rate(station_phase_duration_seconds_sum{{{HERE}, phase=~"{phases}"}}[$__rate_interval])'
    number = f"sum(rate({LASTED}_count{{{HERE}}}[$__rate_interval]))"
    return f"sum by (phase) ({took}) / ignoring (phase) group_left {number}"


HEALTH = (
    prom("number", "Ready", "bool_yes_no", "Whether a trigger would be accepted; /readyz says why not.", "metrics.md",
         (f"station_ready{{{HERE}}}", "ready"), width=4),
    prom("number", "Up since", "s", "How long the station's service has run.", "reliability.md",
         (f"time() - process_start_time_seconds{{{HERE}}}", "service"), width=4),
    prom("number", "Alarms", "short", "Active alarms, by priority.", "alarms.md",
         (f"sum by (priority) (station_alarms_active{{{HERE}}})", "{{priority}}"), width=8),
    prom("number", "Runs", "none", "The program's version and its Python.", "metrics.md",
         (f"station_build_info{{{HERE}}}", "{{version}}, Python {{python}}"), width=8),
    prom("table", "Every alarm", "bool_yes_no",
         "Active alarms are on top. The document of each describes the action.", "alarms.md",
         f"sort_desc(max by (id, priority) (station_alarms_active{{{HERE}}}))"),
    prom("lines", "Last heard", "s",
         "Time since each device, process and the PLC's heartbeat were heard: seconds mean that it is away.",
         "alarms.md#arm-link-lost", (f"station_link_age_seconds{{{HERE}}}", "{{link}}")),
    prom("lines", "Started again", "short", "Processes of the station that ended and were started again, in the last "
         "half hour, and events that the cycle's table does not list.", "alarms.md#process-restarts",
         (f"station_process:restarts:increase30m{{{HERE}}}", "{{process}}"),
         (f"increase(station_unexpected_events_total{{{HERE}}}[30m])", "unexpected events")),
)  # fmt: skip
CYCLE = (
    prom("lines", "Cycle and its deadline", "s", "From trigger to outcome; what reaches the deadline is NO_RESULT.",
         "alarms.md#deadline-missed",
         (f"histogram_quantile(0.5, sum by (fruit, le) (rate({LASTED}_bucket{{{HERE}}}[15m])))", "{{fruit}}, median"),
         (f"station_fruit:cycle:p95_15m{{{HERE}}}", "{{fruit}}, 95 of 100"),
         (f"station_inspection_deadline_seconds{{{HERE}}}", "{{fruit}}, deadline")),
    prom("lines", "Share of the deadline", "percentunit", "Of the slowest twentieth; above 90 % CycleNearDeadline.",
         "alarms.md#deadline-missed", (f"station_fruit:cycle_share:p95_15m{{{HERE}}}", "{{fruit}}")),
    prom("stacked", "Where a cycle's time goes", "s", "Mean seconds in each phase, per inspection.", "cycle-time.md",
         (mean_of(".+"), "{{phase}}")),
    prom("stacked", "Arm", "s", "Mean seconds of its way to the fruit: longer with the speed slider down.",
         "alarms.md#arm-link-lost",
         (mean_of("approaching"), "{{phase}}"), width=12),
    prom("stacked", "Gripper", "s", "Mean seconds of closing and settling, per inspection: slower where it is stiff.",
         "alarms.md#gripper-jam", (mean_of("closing_to_onset|moving.*|settling.*"), "{{phase}}"), width=12),
)  # fmt: skip
SENSOR = (
    prom("stacked", "Frames", "cps", "A second, by what is wrong with them; good where nothing.",
         "alarms.md#camera-stale",
         (f"sum by (state) (rate(station_frames_total{{{HERE}}}[$__rate_interval]))", "{{state}}")),
    prom("lines", "Bad frames", "percentunit", "Share over a quarter of an hour; above 2 % CameraDying.",
         "alarms.md#camera-stale", (f"station:frames_bad_ratio:15m{{{HERE}}}", "bad")),
    prom("lines", "References refused", "short", "Pictures of the untouched gel that could not serve, in a quarter of "
         "an hour, by why: dirt, a dead light, a torn gel.", "alarms.md#reference-bad",
         (f"station_id:references_refused:increase15m{{{HERE}}}", "{{id}}")),
    prom("lines", "Drift of the reference", "suffix: grey levels", "How far the light is from the golden reference's: "
         "from 12.5 ReferenceDrifting, from 25 nothing is inspected.", "alarms.md#reference-drifting",
         (f"station_reference_drift_grey_levels{{{HERE}}}", "drift")),
    prom("lines", "Age of the reference", "s", "Of the one in use, which is taken anew for each fruit.",
         "alarms.md#reference-bad", (f"station_reference_age_seconds{{{HERE}}}", "age")),
    prom("number", "Calibration and verification", "s", "How old they are.", "alarms.md#calibration-old",
         (f"station_calibration_age_seconds{{{HERE}}}", "calibration"),
         (f"station_verification_age_seconds{{{HERE}}}", "verification"), width=4),
    prom("number", "The ball's area", "percentunit", "Change since the calibration, by the last verification; 10 % are "
         "too many: a worn gel.", "alarms.md#calibration-old", (f"station_calibration_drift_ratio{{{HERE}}}", "change"),
         width=4),
)  # fmt: skip
LINE = (
    prom("lines", "PLC", "s", "Time since its heartbeat changed, and since the last query of its interface's process.",
         "alarms.md#plc-heartbeat-lost", (f'station_link_age_seconds{{{HERE}, link=~"plc.*"}}', "{{link}}")),
    prom("lines", "Outcomes that wait", "short", "For the PLC's acknowledgement.", "plc/handshake.md",
         (f"station_outcomes_waiting{{{HERE}}}", "waiting")),
    prom("lines", "Triggers refused", "short", "In a quarter of an hour, by why.", "plc/handshake.md",
         (f"sum by (reason) (increase(station_triggers_refused_total{{{HERE}}}[15m]))", "{{reason}}")),
)  # fmt: skip
RECORDS = (
    prom("lines", "Free space", "bytes", "On the records' disk.", "alarms.md#disk-low",
         (f"station_records_free_bytes{{{HERE}}}", "free")),
    prom("stacked", "Records", "bytes", "What they take, database and images.", "records.md",
         (f"station_records_bytes{{{HERE}}}", "{{kind}}")),
    prom("lines", "Images", "short", "A minute, by what became of them.", "records.md",
         (f"60 * sum by (result) (rate(station_records_images_total{{{HERE}}}[$__rate_interval]))", "{{result}}")),
    prom("lines", "Writes and failures", "cps", "Transactions a second, and requests that failed, by why.",
         "alarms.md#records-not-writable",
         (f"rate(station_records_writes_total{{{HERE}}}[$__rate_interval])", "written"),
         (f"rate(station_records_failures_total{{{HERE}}}[$__rate_interval])", "{{code}}")),
    prom("lines", "Waiting for the disk", "short", "Requests, and inspections whose images wait.", "records.md",
         (f"station_records_queue{{{HERE}}}", "requests"), (f"station_records_images_queue{{{HERE}}}", "images of")),
    prom("lines", "Last write", "s", "How long ago.", "records.md",
         (f"station_records_last_write_age_seconds{{{HERE}}}", "age")),
)  # fmt: skip
OUTBOX = (
    prom("lines", "Undelivered", "short", "Entries that wait for another system, and events that it did not take.",
         "alarms.md#outbox-behind", (f"station_outbox_waiting{{{HERE}}}", "{{destination}}"),
         (f"station_outbox_refused_total{{{HERE}}}", "{{destination}}, refused")),
    prom("lines", "Behind by", "s", "Age of the first entry that waits, and time since the outbox was heard.",
         "alarms.md#outbox-behind", (f"station_outbox_lag_seconds{{{HERE}}}", "{{destination}}"),
         (f"station_outbox_heard_age_seconds{{{HERE}}}", "outbox heard")),
    prom("lines", "Connected", "bool_yes_no", "Whether the other system can be reached.", "outbox.md",
         (f"station_outbox_connected{{{HERE}}}", "{{destination}}"), largest=1),
)  # fmt: skip
MACHINE = (
    prom("lines", "Processor", "percentunit", "Of one core, by the service.", "cycle-time.md",
         (f"rate(process_cpu_seconds_total{{{HERE}}}[$__rate_interval])", "service")),
    prom("lines", "Memory", "bytes", "Of the service; it should stay constant after a day.", "reliability.md",
         (f"process_resident_memory_bytes{{{HERE}}}", "service")),
    prom("lines", "Open files", "short", "Of the service; a number that only rises is a leak.", "reliability.md",
         (f"process_open_fds{{{HERE}}}", "service")),
)  # fmt: skip


def dashboard() -> Any:
    """Return the dashboard."""
    rows = {"Health": HEALTH, "Cycle": CYCLE, "Sensor": SENSOR, "PLC": LINE, "Records": RECORDS, "Outbox": OUTBOX}
    station = chosen("station", "Station", STATIONS, several=False)
    about = "Is this station healthy, and if not, which part is at fault?"
    return board("fruit-station", "Station", about, (station,), {**rows, "Machine": MACHINE})

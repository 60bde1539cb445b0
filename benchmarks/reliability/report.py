"""The page that the measured rows make."""

import re
from collections import Counter
from collections.abc import Sequence

from .play import Row
from .scenario import ClockFault, DeviceFault, DiskFault, NestFault, Phase, PlcFault, ProcessFault, Scenario

_ELSEWHERE = re.compile(r"/tmp/[^/ ]+/")
_HEAD = """# Effect of faults on the fruit

<!-- made by ./run bench faults -->

Written by `./run bench faults`: the simulated cell, the station's process and the PLC interface as real processes
under the supervisor, the line's PLC program on Modbus TCP. In each row a fault begins at a phase of one fruit's
inspection, as seen from outside the station, and ends; then a good fruit is inspected. A row is passed if

- the accepted trigger got exactly one result, with its own id, that never changed or came again,
- the record in SQLite equals what the PLC read, and is acknowledged,
- a PASS has a complete curve that the station judged as PASS,
- the jaws are open at the end, by the twin's truth,
- the station was ready again by itself, or stayed stopped, gave the reason, and was ready after the given commands,
- the next fruit, a good one, got PASS.

Phases: *trigger*: the PLC has read its trigger as accepted; *approach*: the arm moves, and the reference is taken on
the way; *closing*: the jaws close without a stop until they touch the fruit; *stepping*: the fruit is deformed by
0.5 mm, in *sweep* while the jaws close on without a stop (`steps.measured: while_closing`); *releasing*: the PLC reads
the result, and the arm leaves; *leaving*: the PLC has read its next trigger as accepted while the arm leaves the fruit
before; the outcome is the second fruit's. To give the faults time in these phases, the arm leaves at a tenth of its
speed there, and the jaws close at a third of theirs in *sweep*. Scenarios and their expected results:
`tests/reliability/scenarios`. The station works with a quick recipe of 6 steps and a `service.patience` of 5, the
factor on the expected times. *Ready again* is from the fault's end, or the last command, to ready for a trigger, on a
machine with other work.

"""


def markdown(rows: Sequence[Row], scenarios: Sequence[Scenario]) -> str:
    """The page.

    Args:
        rows: measured.
        scenarios: of the rows, and what was not run.
    """
    known = {scenario.name: scenario for scenario in scenarios}
    held = sum(not row.wrong and not row.skipped for row in rows)
    skipped = sum(bool(row.skipped) for row in rows)
    lines = [
        f"{len(rows)} rows: {held} passed, {len(rows) - held - skipped} failed, {skipped} could not be run.",
        f"Played: {_days(rows)}.",
        "Rows of an earlier day quote the messages of that day.",
        "",
        "| fault | phase | outcome | alarms | ready again | passed |",
        "|---|---|---|---|---|---|",
        *(_line(row, known[row.scenario]) for row in rows),
        "",
        "## Reasons for not ready",
        "",
        "The last sentence at `/readyz` while it was not ready, in the phase stepping or the first played.",
        "",
        "| fault | why not ready |",
        "|---|---|",
        *_sentences(rows),
        "",
        *_section("Not played", _unplayed(rows, scenarios)),
        *_section("Remarks", [f"- `{scenario.name}`: {scenario.remark}" for scenario in scenarios if scenario.remark]),
    ]
    return _HEAD + "\n".join(lines)


def _section(title: str, lines: Sequence[str]) -> list[str]:
    """A section's lines; nothing for one without content."""
    return [f"## {title}", "", *lines, ""] if lines else []


def _days(rows: Sequence[Row]) -> str:
    """Return the number of rows played on each day, in words: a run of some scenarios leaves the others' rows."""
    days = Counter(row.played_on for row in rows)
    return ", ".join(f"{days[day]} {f'on {day}' if day else 'on an earlier day'}" for day in sorted(days))


def _line(row: Row, scenario: Scenario) -> str:
    outcome = f"{row.outcome}: {', '.join(row.reasons)}" if row.reasons else row.outcome
    verbs = ", ".join(f"`{remedy}`" for remedy in scenario.remedy)
    back = "" if row.recovered_s is None else f"{row.recovered_s:.1f} s {'after ' + verbs if verbs else 'by itself'}"
    holds = f"skipped: {row.skipped}" if row.skipped else f"**no**: {'; '.join(row.wrong)}" if row.wrong else "yes"
    cells = (_named(scenario), row.phase, outcome, ", ".join(f"`{alarm}`" for alarm in row.alarms), back, holds)
    return f"| {' | '.join(cells)} |"


def _named(scenario: Scenario) -> str:
    return f"{_fault(scenario)}, in *sweep*" if scenario.measured == "while_closing" else _fault(scenario)


def _fault(scenario: Scenario) -> str:
    fault = scenario.fault
    if isinstance(fault, DeviceFault):
        amount = "" if fault.amount == 1.0 else f" {fault.amount:g}"
        return f"{fault.device} `{fault.fault}`{amount}, {scenario.lasts_s:g} s"
    if isinstance(fault, ProcessFault):
        stood = f", {scenario.lasts_s:g} s" if fault.signal == "SIGSTOP" else ""
        return f"{fault.signal} to {fault.process}{stood}"
    if isinstance(fault, DiskFault):
        return f"records' disk {fault.disk.replace('_', '-')}, {scenario.lasts_s:g} s"
    if isinstance(fault, ClockFault):
        return f"clock {fault.step_s:+g} s, {scenario.lasts_s:g} s"
    if isinstance(fault, PlcFault):
        what = "is away" if fault.plc == "lost" else "writes nonsense"
        return f"the PLC {what}, {scenario.lasts_s:g} s"
    return "the fruit falls out" if isinstance(fault, NestFault) else "none"


def _unplayed(rows: Sequence[Row], scenarios: Sequence[Scenario]) -> list[str]:
    played = {(row.scenario, row.phase) for row in rows}
    left = {each.name: [phase for phase in each.phases if (each.name, phase.value) not in played] for each in scenarios}
    return [f"- `{name}`: {', '.join(phases)}; not run yet." for name, phases in left.items() if phases]


def _sentences(rows: Sequence[Row]) -> list[str]:
    chosen: dict[str, str] = {}
    for row in rows:
        if row.why and (row.scenario not in chosen or row.phase == Phase.STEPPING):
            chosen[row.scenario] = row.why
    return [f"| {name} | {_ELSEWHERE.sub('…/', why.replace('|', '/'))} |" for name, why in chosen.items()]

"""The fault matrix: every scenario of tests/reliability/scenarios in its phases, on the real processes.

Run with `./run bench faults`, or a part by name: `./run bench faults arm_link_cut service_killed --phase stepping`.
The last rows of each scenario are in benchmarks/reliability/measured.json; docs/reliability.md is made from them.
Exits 1 where a row does not hold.
"""

import argparse
import asyncio
import fcntl
import json
import shutil
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from reliability.clock import CannotDoError
from reliability.play import Row, play
from reliability.report import markdown
from reliability.rig import running
from reliability.scenario import Phase, Scenario, load_scenarios

from station.errors import BadInputError, StationError

ROOT = Path(__file__).resolve().parents[1]
SCENARIOS = ROOT / "tests" / "reliability" / "scenarios"
MEASURED = ROOT / "benchmarks" / "reliability" / "measured.json"
PAGE = ROOT / "docs" / "reliability.md"


async def run_scenario(scenario: Scenario, phases: Sequence[Phase], logs: Path | None) -> list[Row]:
    """Play one scenario on a station of its own, and go on with another one after a row that does not hold."""
    rows, left = list[Row](), list(phases)
    while left:
        with tempfile.TemporaryDirectory(prefix="faults-") as name:
            folder = Path(name)
            try:
                async with running(folder, scenario) as rig:
                    while left:
                        rows.append(await play(rig, scenario, left.pop(0)))
                        print(line_of(rows[-1]), flush=True)
                        if rows[-1].wrong:
                            break
            except CannotDoError as error:
                rows += [Row(scenario=scenario.name, phase=phase.value, skipped=str(error)) for phase in left]
                left = []
            except StationError as error:
                rows.append(Row(scenario=scenario.name, phase=left.pop(0).value, wrong=(f"no station: {error}",)))
                print(line_of(rows[-1]), flush=True)
            if logs is not None and rows and rows[-1].wrong:
                shutil.copytree(folder / "logs", logs / f"{scenario.name}-{rows[-1].phase}", dirs_exist_ok=True)
    return rows


def line_of(row: Row) -> str:
    """A row in one line."""
    how = f"skipped: {row.skipped}" if row.skipped else "; ".join(row.wrong) or "holds"
    back = "" if row.recovered_s is None else f", ready after {row.recovered_s} s"
    reasons = f" ({', '.join(row.reasons)})" if row.reasons else ""
    return f"{row.scenario:24} {row.phase:10} {row.outcome or '-'}{reasons}{back}: {how}"


def keep(rows: Sequence[Row], scenarios: Sequence[Scenario]) -> None:
    """Put rows in the place of the same ones measured before, and make the page anew."""
    with MEASURED.open("a+", encoding="utf-8") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        file.seek(0)
        known = {(row.scenario, row.phase): row for row in map(Row.model_validate, json.loads(file.read() or "[]"))}
        known |= {(row.scenario, row.phase): row for row in rows}
        wanted = [
            known[key] for scenario in scenarios for phase in scenario.phases
            if (key := (scenario.name, phase.value)) in known
        ]  # fmt: skip
        file.truncate(0)
        lines = ",\n".join(row.model_dump_json(exclude_defaults=True) for row in wanted)
        file.write(f"[\n{lines}\n]\n")
        PAGE.write_text(markdown(wanted, scenarios), encoding="utf-8")


async def run_all(
    chosen: Sequence[Scenario],
    phases: Sequence[Phase],
    logs: Path | None,
    scenarios: Sequence[Scenario],
    *,
    stored: bool,
) -> bool:
    """Play them one after the other. Whether all held."""
    held = True
    for scenario in chosen:
        rows = await run_scenario(scenario, [phase for phase in scenario.phases if phase in phases], logs)
        held &= not any(row.wrong for row in rows)
        if stored:
            keep(rows, scenarios)
    return held


def main() -> None:
    """Play what was requested."""
    parser = argparse.ArgumentParser(description="The fault matrix on the real processes.")
    parser.add_argument("names", nargs="*", metavar="SCENARIO", help="all where none is given")
    parser.add_argument("--phase", action="append", choices=list(Phase), type=Phase, help="may be repeated")
    parser.add_argument("--logs", type=Path, help="where the processes' logs of rows that do not hold go")
    parser.add_argument("--scenarios", type=Path, default=SCENARIOS, help="a folder of other scenario files")
    parser.add_argument("--dry", action="store_true", help="leave the page as it is")
    parser.add_argument("--list", action="store_true", help="name the scenarios")
    options = parser.parse_args()
    try:
        scenarios = load_scenarios(options.scenarios)
    except BadInputError as error:
        print(error, file=sys.stderr)
        sys.exit(2)
    unknown = set(options.names) - {scenario.name for scenario in scenarios}
    if unknown or options.list:
        print("scenarios: " + ", ".join(scenario.name for scenario in scenarios))
        sys.exit(2 if unknown else 0)
    chosen = [scenario for scenario in scenarios if not options.names or scenario.name in options.names]
    held = asyncio.run(run_all(chosen, options.phase or list(Phase), options.logs, scenarios, stored=not options.dry))
    sys.exit(0 if held else 1)


if __name__ == "__main__":
    main()

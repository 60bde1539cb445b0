"""The fault matrix's page: made from its rows, and honest about when each was played."""

import json
from pathlib import Path

from benchmarks.reliability.play import Row
from benchmarks.reliability.report import markdown
from benchmarks.reliability.scenario import load_scenarios

ROOT = Path(__file__).resolve().parents[2]
SCENARIOS = load_scenarios(ROOT / "tests" / "reliability" / "scenarios")


def test_the_page_is_what_the_measured_rows_make():
    measured = json.loads((ROOT / "benchmarks" / "reliability" / "measured.json").read_text(encoding="utf-8"))
    page = (ROOT / "docs" / "reliability.md").read_text(encoding="utf-8")
    assert page == markdown([Row.model_validate(row) for row in measured], SCENARIOS)


def test_rows_of_several_runs_are_counted_by_the_day_on_which_they_were_played():
    days = ("2026-11-25", "", "2026-11-25")
    rows = [Row(scenario="sweep", phase="trigger", outcome="PASS", played_on=day) for day in days]
    assert "\nPlayed: 1 on an earlier day, 2 on 2026-11-25.\n" in markdown(rows, SCENARIOS)

"""One list of outcomes at the doors where people read a share of it: a word is the same number at each."""

import re
from types import SimpleNamespace
from typing import Any

import pytest
import yaml

from benchmarks.archive import postgres
from benchmarks.monitoring.prometheus import RULES
from benchmarks.monitoring.queries import panels, sql
from hmi.run.routes import PARTS
from hmi.web.translation import Locale
from station.channel.panel_run import FruitSummary
from station.vocabulary import OutcomeName
from station.whatif.outcome_table import counted
from station.whatif.replay import Replayed

NUMBERS: dict[OutcomeName, int] = {"PASS": 90, "FAIL": 6, "NO_RESULT": 4}
DIVERTED = 10 / 100
REJECT_RATE = 6 / 96
NOT_JUDGED = 4 / 100
PANELS = panels()


def test_diverted_is_fail_and_no_result_of_all_fruit():
    outcomes = [name for name, number in NUMBERS.items() for _ in range(number)]
    fruit = tuple(
        FruitSummary(
            sequence=number, outcome=outcome, reasons=(), ended_utc_ms=number, duration_ms=1, recipe="blueberry",
            lot="L7", area_mm2=None, closing_mm=None, areas_mm2=(),
        )
        for number, outcome in enumerate(outcomes, 1)
    )  # fmt: skip
    gateway: Any = SimpleNamespace(state=None, last=None, recent=SimpleNamespace(fruit=fruit))
    part = PARTS["run.figures"]
    assert part.values(gateway, Locale("en"))["diverted"] == DIVERTED
    assert Locale("en").text("run.diverted") == "Diverted"
    judged_again = counted(Replayed(n, "L7", each, each, None, faithful=True) for n, each in enumerate(outcomes, 1))
    assert judged_again.rejects_before() / judged_again.decided == DIVERTED


def test_the_reject_rate_in_postgresql_is_of_the_judged_fruit(postgresql_programs):
    chosen = {"station": ["a"], "fruit": ["blueberry"]}
    rates, unjudged = {}, {}
    with postgres.throwaway(postgresql_programs) as server, server.connect() as connection:
        for outcome, number in NUMBERS.items():
            connection.execute(
                "INSERT INTO hourly_outcomes VALUES ('2026-01-05 10:00Z', 'a', 'L7', 'blueberry', '', %s, %s, "
                "'2026-01-05 10:05Z')",
                (outcome, number),
            )
        for panel in PANELS:
            for target in panel.targets:
                if " AS failed" in target.get("rawSql", ""):
                    text = sql(target["rawSql"], "2026-01-05T00:00Z", "2026-01-06T00:00Z", **chosen)
                    cursor = connection.execute(text.encode())
                    [row] = cursor.fetchall()
                    cells = dict(zip([column.name for column in cursor.description or ()], row, strict=True))
                    rates[panel.title] = cells["failed"]
                    if "not judged" in cells:
                        unjudged[panel.title] = cells["not judged"]
    assert len(rates) == 4
    assert set(rates.values()) == {REJECT_RATE}
    assert unjudged == {"Lots": NOT_JUDGED}


def test_the_reject_rate_in_prometheus_is_of_the_judged_fruit(promtool, tmp_path):
    """Each minute of the hour has the numbers once."""
    series = [
        {
            "series": f'station_inspections_total{{station="a",fruit="blueberry",outcome="{outcome}",reason=""}}',
            "values": f"0+{number}x180",
        }
        for outcome, number in NUMBERS.items()
    ]
    labels = '{station="a",fruit="blueberry"}'
    wanted = {"reject_ratio:1h": REJECT_RATE, "reject_ratio:7d": REJECT_RATE, "unjudged_ratio:1h": NOT_JUDGED}
    checks = [
        {
            "expr": f"round(station_fruit:{name}, 1e-6)",
            "eval_time": "3h",
            "exp_samples": [{"labels": labels, "value": round(value, 6)}],
        }
        for name, value in wanted.items()
    ]
    file = tmp_path / "shares.yml"
    group = {"interval": "1m", "input_series": series, "promql_expr_test": checks}
    text = {"rule_files": [str(RULES / "recording.yml")], "evaluation_interval": "1m", "tests": [group]}
    file.write_text(yaml.safe_dump(text))
    assert "SUCCESS" in promtool("test", "rules", file)


@pytest.mark.parametrize(
    ("query", "base"),
    [(r"reject_ratio| AS failed", "share of the judged fruit"), (r'unjudged_ratio| AS "not judged"', "of all fruit")],
)
def test_a_panel_with_a_share_says_of_what(query, base):
    found = [panel for panel in PANELS if re.search(query, str(panel.targets))]
    assert len(found) >= 4
    assert [panel.title for panel in found if base not in panel.data["description"].lower()] == []

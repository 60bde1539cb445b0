"""Scraping, rules and alerts as they are shipped."""

import re
from pathlib import Path

import pytest
import yaml

from benchmarks.monitoring import document
from benchmarks.monitoring.document import headings
from benchmarks.monitoring.history import episodes
from benchmarks.monitoring.prometheus import RULES, SHIPPED, recordings, shipped_alerts
from benchmarks.monitoring.queries import unfiltered
from station.inspection.alarm_table import ALARMS

ROOT = SHIPPED.parents[1]
ALERTS = shipped_alerts()
WANTED = {
    "RejectRateHigh", "NoResultRising", "CycleNearDeadline", "CameraDying", "ReferenceDrifting", "GelWorn",
    "PlcHeartbeatLost", "OutboxGrowing", "DiskFilling", "CalibrationOld", "ProcessRestarts", "StationDown", "HmiLost",
    "Watchdog",
}  # fmt: skip


def test_configuration_and_rules_are_sound(promtool):
    assert "SUCCESS" in promtool("check", "config", SHIPPED / "prometheus.yml")
    assert "SUCCESS" in promtool("check", "rules", *sorted(RULES.glob("*.yml")))


@pytest.mark.timeout(300)
def test_every_alert_fires_where_it_should_and_nowhere_else(promtool):
    assert "FAILED" not in promtool("test", "rules", *sorted((SHIPPED / "tests").glob("*.yml")))


def test_every_alert_is_fired_by_a_rule_test():
    rule_tests = "".join(file.read_text(encoding="utf-8") for file in (SHIPPED / "tests").glob("*.yml"))
    assert set(re.findall(r'alertname="(\w+)"', rule_tests)) >= set(ALERTS)
    assert set(ALERTS) >= WANTED


@pytest.mark.parametrize("name", ALERTS)
def test_an_alert_says_what_an_alarm_says(name):
    rule = ALERTS[name]
    assert set(rule["annotations"]) == {"summary", "cause", "consequence", "action", "runbook"}
    assert rule["labels"]["severity"] in {"critical", "high", "medium", "low", "none", "{{ $labels.priority }}"}
    for key in ("cause", "consequence", "action"):
        assert rule["annotations"][key].endswith(".")
    runbook = rule["annotations"]["runbook"]
    for link in [runbook] if "{{" not in runbook else [runbook.split("{{")[0] + a.replace("_", "-") for a in ALARMS]:
        path, _, anchor = link.partition("#")
        assert (ROOT / path).is_file(), link
        assert not anchor or anchor in headings(ROOT / path), link


def test_the_document_has_every_alert():
    text = document.DOCUMENT.read_text(encoding="utf-8")
    assert document.with_part(text, "alerts", document.alerts()) == text
    assert all(f"\n| [{name}](" in text for name in ALERTS)


def test_recorded_series_are_named_by_their_level_and_none_is_unused():
    queries = " ".join([*recordings().values(), *(rule["expr"] for rule in ALERTS.values())])
    boards = " ".join(file.read_text() for file in (ROOT / "deploy" / "grafana" / "dashboards").glob("*.json"))
    for name in recordings():
        assert re.fullmatch(r"[a-z_]+:[a-z_]+:[a-z0-9_]+", name)
        assert name in queries + boards


def test_alertmanager_wakes_for_what_is_high_and_watches_the_watchdog():
    settings = yaml.safe_load((SHIPPED / "alertmanager.yml").read_text())
    receivers = {each["name"] for each in settings["receivers"]}
    routes = settings["route"]["routes"]
    assert {settings["route"]["receiver"], *(route["receiver"] for route in routes)} == receivers
    for matcher in [line for rule in settings["inhibit_rules"] for line in rule["source_matchers"]]:
        assert set(re.findall(r'"(\w+)"', matcher)) <= set(ALERTS)
    assert [route["matchers"] for route in routes] == [
        ['alertname = "Watchdog"'],
        ['severity =~ "critical|high"'],
    ]
    urls = [each["url_file"] for receiver in settings["receivers"] for each in receiver["webhook_configs"]]
    assert all(Path(url).is_absolute() for url in urls), "no secret is in the repository"


@pytest.mark.parametrize(
    ("expr", "values"),
    [
        ('up{job="a"} == 0', 'up{job="a"} == bool 0'),
        ('sum(a{b!~"c>d"}) > 2 * c\nand d >= 1', 'sum(a{b!~"c>d"}) > bool 2 * c\nand d >= bool 1'),
        ('absent(up{job="a"})', 'up{job="a"}'),
    ],
)
def test_comparisons_are_asked_for_as_values(expr, values):
    assert unfiltered(expr) == values


@pytest.mark.parametrize(
    ("true_s", "for_s", "keep_s", "fired"),
    [
        ([], 0, 0, []),
        ([10, 20, 30], 0, 0, [(10, 30)]),
        ([10, 20, 30], 20, 0, [(30, 30)]),
        ([10, 20, 40, 50], 20, 0, []),
        ([10, 20, 50, 60], 0, 30, [(10, 90)]),
        ([10, 20, 60, 70], 0, 30, [(10, 50), (60, 100)]),
        ([10, 20, 60], 20, 30, []),
    ],
)
def test_an_alert_waits_and_goes_on_as_prometheus_has_it(true_s, for_s, keep_s, fired):
    assert list(episodes(true_s, 10, for_s, keep_s)) == fired

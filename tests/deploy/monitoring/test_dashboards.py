"""The dashboards as they are committed."""

import re
import time

import pytest
import yaml

from benchmarks.monitoring.document import headings
from benchmarks.monitoring.prometheus import running, write_configuration
from benchmarks.monitoring.queries import DASHBOARDS, dashboards, panels
from deploy.grafana.boards.export import exported

ROOT = DASHBOARDS.parents[2]
PANELS = panels()
PROVISIONING = DASHBOARDS.parent / "provisioning"


def test_the_files_are_what_the_code_makes():
    for path, text in exported().items():
        assert path.read_text(encoding="utf-8") == text, f"{path.name}: run python -m deploy.grafana.boards"
    assert set(exported()) == set(DASHBOARDS.glob("*.json"))


@pytest.mark.parametrize("panel", PANELS, ids=lambda panel: f"{panel.board} {panel.title}")
def test_a_panel_has_a_unit_a_description_and_a_link(panel):
    data = panel.data
    assert data["fieldConfig"]["defaults"]["unit"]
    assert data["description"].endswith(".")
    assert data["targets"]
    path, _, anchor = data["links"][0]["url"].removeprefix("${docs}/").partition("#")
    assert (ROOT / "docs" / path).is_file(), path
    assert not anchor or anchor in headings(ROOT / "docs" / path), anchor


def test_no_shares_are_stacked():
    """Two growers of whose fruit 60 % failed do not make 120 %."""
    shares = [panel for panel in PANELS if panel.data["fieldConfig"]["defaults"]["unit"] == "percentunit"]
    assert shares
    for panel in shares:
        stacking = panel.data["fieldConfig"]["defaults"].get("custom", {}).get("stacking", {})
        assert stacking.get("mode", "none") == "none", panel.title


@pytest.mark.parametrize("name", dashboards())
def test_a_dashboard_can_be_loaded(name):
    board = dashboards()[name]
    variables = {each["name"] for each in board["templating"]["list"]}
    queries = " ".join(str(panel.data) for panel in PANELS if panel.board == name)
    for variable in re.findall(r"\$\{?([a-z_]+)(?::\w+)?\}?", re.sub(r"\$__\w+", "", queries)):
        assert variable in variables
    numbers = [panel.data["id"] for panel in PANELS if panel.board == name]
    assert len(set(numbers)) == len(numbers)
    cells = [
        (panel.data["gridPos"]["x"] + x, panel.data["gridPos"]["y"] + y)
        for panel in PANELS
        if panel.board == name
        for x in range(panel.data["gridPos"]["w"])
        for y in range(panel.data["gridPos"]["h"])
    ]
    assert len(set(cells)) == len(cells), "panels overlap"
    assert all(x < 24 for x, _ in cells)


def test_uids_are_unique_and_datasources_are_provisioned():
    uids = [board["uid"] for board in dashboards().values()]
    assert len(set(uids)) == len(uids) == 4
    known = yaml.safe_load((PROVISIONING / "datasources" / "fruit-station.yaml").read_text())["datasources"]
    used = {(target["datasource"]["type"], target["datasource"]["uid"]) for panel in PANELS for target in panel.targets}
    assert used == {(each["type"], each["uid"]) for each in known}
    secrets = [each["secureJsonData"]["password"] for each in known if "secureJsonData" in each]
    assert all(re.fullmatch(r"\$\{\w+\}", secret) for secret in secrets)


@pytest.mark.timeout(120)
def test_a_station_that_is_off_can_be_selected(promtool, tmp_path):
    """Prometheus has only its `up`, which is 0: nothing of its own for as long as it is off."""
    queries = {
        variable["query"]
        for board in dashboards().values()
        for variable in board["templating"]["list"]
        if variable["name"] == "station" and variable["query"].startswith("label_values")
    }
    configuration = write_configuration(tmp_path, "1s", {"dead": "127.0.0.1:1"})
    with running(tmp_path, configuration) as prometheus:
        until_s = time.monotonic() + 60
        while not prometheus.now("up == 0"):
            assert time.monotonic() < until_s
            time.sleep(0.1)
        for query in queries:
            found = re.fullmatch(r"label_values\((.+), (\w+)\)", query)
            assert found
            assert [each.labels[found[2]] for each in prometheus.now(found[1])] == ["dead"], query
    assert queries

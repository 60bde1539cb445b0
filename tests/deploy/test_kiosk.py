"""The panel's kiosk: its unit, its browser's policy and its user fit together, and its address is a page."""

import configparser
import json
import re
import subprocess
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from hmi.web.navigation import modules
from tests.tools import optional


@pytest.fixture
def kiosk(root: Path) -> Path:
    return root / "deploy" / "kiosk"


@pytest.fixture
def unit(kiosk: Path) -> configparser.ConfigParser:
    parser = configparser.ConfigParser(interpolation=None, strict=False)
    parser.optionxform = str  # pyrefly: ignore[bad-assignment] (as configparser's page has it)
    parser.read(kiosk / "fruit-station-kiosk.service")
    return parser


def test_the_browser_opens_the_page_that_gives_a_keyboard_and_may_open_it(unit, kiosk):
    address = urlsplit(unit["Service"]["Environment"].removeprefix("PANEL_ADDRESS="))
    assert "${PANEL_ADDRESS}" in unit["Service"]["ExecStart"]
    paths = {route.path for module in modules() for route in module.router.routes}
    assert address.path in paths
    policy = json.loads((kiosk / "policy.json").read_text())
    assert policy["URLBlocklist"] == ["*"]
    assert policy["URLAllowlist"] == [address.netloc]


def test_its_user_is_made_and_has_no_rights_on_the_station(unit, kiosk):
    lines = [line for line in (kiosk / "fruit-panel.conf").read_text().splitlines() if not line.startswith("#")]
    assert [line.split()[:2] for line in lines] == [["u", unit["Service"]["User"]]]


def test_the_guide_names_every_file(kiosk, root):
    guide = (root / "docs" / "panel.md").read_text()
    assert all(f"`{path.name}`" in guide for path in kiosk.iterdir())


def test_the_unit_is_one_that_systemd_reads(kiosk, tmp_path):
    verify = optional("systemd-analyze")
    unit = tmp_path / "fruit-station-kiosk.service"
    text = (kiosk / unit.name).read_text()
    unit.write_text(re.sub(r"^ExecStart=/usr/bin/cage", "ExecStart=/bin/true", text, flags=re.MULTILINE))
    done = subprocess.run([verify, "verify", unit], capture_output=True, text=True, check=False, timeout=60)
    found = [line for line in done.stderr.splitlines() if "fruit-station-kiosk" in line]
    assert not any("Unknown" in line or "Invalid" in line or "Failed to parse" in line for line in found), found

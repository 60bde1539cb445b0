"""The minimal configuration of a real cell: it loads, and has nothing that is not needed."""

from pathlib import Path

import yaml

from station.settings.configuration import Configuration, load_configuration

FILE = Path(__file__).resolve().parents[2] / "deploy" / "station.minimal.yaml"
NEEDED = {"modbus", "hmi", "arm", "gripper", "camera"}


def test_it_is_a_valid_configuration_of_real_devices():
    site = load_configuration(FILE, {})
    assert (site.camera.driver, site.camera.digit.serial) == ("digit", "D20966")
    assert not site.arm.host.startswith("127.")
    assert site.gripper.urcap.host == site.arm.host


def test_each_section_of_it_changes_a_default():
    given = yaml.safe_load(FILE.read_text())
    assert given.keys() == NEEDED
    site, default = load_configuration(FILE, {}), Configuration()
    assert {name for name in given if getattr(site, name) == getattr(default, name)} == set()

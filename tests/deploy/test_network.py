"""The network plan: nothing of the configuration is missing in it, and its rules are what nftables takes."""

import os
import subprocess

import pytest
from click.testing import CliRunner

from station.cli import cli
from station.settings import network_export
from station.settings.conduits import Zone, conduits
from station.settings.configuration import Configuration, load_configuration
from station.settings.firewall import rules
from station.settings.schema import leaves, schema_of
from tests.tools import optional

NO_CONDUIT = {
    "can.port": "udp_multicast is the twin's, and does not leave the machine",
}
"""Ports that no other machine ever sees, and why."""


def test_every_port_and_host_of_the_configuration_is_in_the_plan():
    fields = {".".join(map(str, leaf.path)) for leaf in leaves(schema_of(Configuration))}
    ports = {field for field in fields if field.split(".")[-1] == "port"}
    hosts = {field.rpartition(".")[0] for field in fields if field.split(".")[-1] == "host"}
    planned = {each.setting for each in conduits(Configuration())}
    assert len(ports) > 6
    assert ports - planned == NO_CONDUIT.keys()
    assert {host for host in hosts if not any(setting.startswith(f"{host}.") for setting in planned)} == set()


def test_a_changed_setting_changes_its_conduit(tmp_path):
    file = tmp_path / "station.yaml"
    file.write_text(
        "modbus: {host: 10.0.0.1, port: 502}\ngripper: {driver: modbus_rtu, modbus_rtu: {line: tcp, port: 4000}}\n"
    )
    plan = {each.setting: each for each in conduits(load_configuration(file, {}))}
    assert (plan["modbus.port"].host, plan["modbus.port"].port) == ("10.0.0.1", 502)
    assert plan["gripper.modbus_rtu.port"].enabled
    assert plan["gripper.modbus_rtu.port"].port == 4000
    assert not plan["gripper.urcap.port"].enabled


def test_documents_drawing_and_example_are_as_the_settings_have_them(root):
    for path, text in network_export.exported(root).items():
        assert path.read_text(encoding="utf-8") == text, f"{path.name}: python -m station.settings.network_export"


def test_what_no_zone_or_peer_is_named_for_stays_closed():
    ruleset = rules(network_export.example_site(), {Zone.OPERATORS: ("10.10.30.0/24", "fd00::/64")})
    assert "ip saddr { 10.10.30.0/24 } tcp dport 8080 accept" in ruleset
    assert "ip6 saddr { fd00::/64 } tcp dport 8080 accept" in ruleset
    assert "dport 502" in ruleset, "who may read Modbus is a setting"
    for closed in ("9108", "dport 22", "1883", "5802"):
        assert closed not in ruleset
    assert ruleset.count("policy drop") == 3


def test_loopback_needs_no_rule():
    assert "dport" not in rules(Configuration(), {Zone.OPERATORS: ("10.0.0.0/8",), Zone.ARCHIVE: ("10.0.0.1",)})


def test_the_command_takes_the_sites_ports(tmp_path):
    file = tmp_path / "station.yaml"
    file.write_text("hmi: {host: 10.0.3.1, port: 8443}\n")
    arguments = ["config", "firewall", "--config", str(file), "--zone", "operators=10.0.3.0/24,10.0.4.7"]
    result = CliRunner().invoke(cli, arguments)
    assert "ip saddr { 10.0.3.0/24, 10.0.4.7/32 } tcp dport 8443 accept" in result.output
    for wrong in ("panels=10.0.0.1", "line=10.0.0", "line="):
        assert CliRunner().invoke(cli, ["config", "firewall", "--zone", wrong]).exit_code == 2


def test_nftables_takes_the_rules(root):
    nft = optional("nft")
    if os.geteuid() != 0:
        pytest.skip("only root may run nft")
    done = subprocess.run([nft, "-c", "-f", root / "deploy/nftables.conf"], capture_output=True, text=True, check=False)
    if "not supported" in done.stderr or "not permitted" in done.stderr:
        pytest.skip(f"this kernel has no nftables: {done.stderr.splitlines()[0]}")
    assert done.returncode == 0, done.stderr

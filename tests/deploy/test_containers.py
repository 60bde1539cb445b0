"""Image and compose file, as far as they can be checked without a container engine: their form and promises."""

import os
import re
import subprocess
import tomllib
from pathlib import Path

import pytest
import yaml

from station.outbox.secrets import password

SERVICES = {"station", "prometheus", "alertmanager", "grafana", "postgresql"}
ELSEWHERE = ("./prometheus/", "./grafana/")
"""Folders of the monitoring, which this test meets only where they are."""
PINNED = re.compile(r"^(docker\.io/[a-z]+/[a-z]+|fruit-station):v?\d+\.\d+(\.\d+)?(-[a-z]+)?$")


@pytest.fixture
def compose(root):
    return yaml.safe_load((root / "deploy/compose.yaml").read_text())


def test_every_service_is_pinned_watched_and_confined(compose):
    assert compose["services"].keys() == SERVICES
    for name, service in compose["services"].items():
        assert PINNED.match(service["image"]), name
        assert service["read_only"], name
        assert service["cap_drop"] == ["ALL"], name
        assert service["security_opt"] == ["no-new-privileges:true"], name
        assert service["logging"]["options"].keys() == {"max-size", "max-file"}, name
        assert service["healthcheck"].keys() == {"test", "interval", "timeout", "start_period", "retries"}, name
        assert service["deploy"]["resources"]["limits"].keys() == {"cpus", "memory", "pids"}, name
        assert not {"privileged", "pid", "ipc", "cap_add", "userns_mode"} & service.keys(), name
        assert service.get("network_mode", "service:").startswith("service:"), name
        assert "user" in service or name == "station", f"{name} would be root"


def test_nothing_is_secret_and_what_is_comes_as_a_file(compose, root):
    text = (root / "deploy/compose.yaml").read_text()
    declared = compose["secrets"]
    for service in compose["services"].values():
        for secret in service.get("secrets", []):
            assert (secret if isinstance(secret, str) else secret["source"]) in declared
        for key, value in service.get("environment", {}).items():
            if re.search("PASSWORD|SECRET|TOKEN|KEY", key):
                assert str(value).startswith("/run/secrets/"), key
                assert key.upper().endswith("FILE"), key
    assert all(each["file"].startswith("./containers/secrets/") for each in declared.values())
    assert all(Path(each["file"]).name in text.split("services:")[0] for each in declared.values()), (
        "not described above"
    )
    tracked = subprocess.run(
        ["git", "ls-files", "deploy/containers/secrets"], cwd=root, capture_output=True, text=True, check=True
    )
    assert tracked.stdout.split() == ["deploy/containers/secrets/.gitignore"]


def test_the_documented_commands_make_every_secret_and_the_station_takes_its_own(compose, root, tmp_path):
    page = (root / "docs/deployment.md").read_text()
    block = re.search(r"```\n(cd deploy\n.*?)```", page, re.DOTALL)
    assert block is not None
    secrets = tmp_path / "containers/secrets"
    secrets.mkdir(parents=True)
    (tmp_path / "sudo").write_text('#!/bin/sh\nshift 5\nexec install "$@"\n')  # only root may give a file away
    (tmp_path / "sudo").chmod(0o755)
    commands = "\n".join(line for line in block[1].splitlines() if line.startswith(("for ", "sudo install -o 990 ")))
    path = f"{tmp_path}:{os.environ['PATH']}"
    subprocess.run(["bash", "-euc", commands], cwd=tmp_path, check=True, timeout=60, env={**os.environ, "PATH": path})
    assert {file.name for file in secrets.iterdir()} == {
        Path(each["file"]).name for each in compose["secrets"].values()
    }
    given = (secrets / "postgresql_station").read_text().strip()
    assert password(secrets / "station_postgresql", "PGPASSWORD") == given
    assert compose["services"]["station"]["secrets"] == ["station_postgresql"]
    assert "station_postgresql" not in compose["services"]["postgresql"]["secrets"], "whose user cannot read it"


def test_what_is_mounted_is_there_and_what_is_written_is_a_volume(compose, root):
    for name, service in compose["services"].items():
        for mount in service["volumes"]:
            source, target, *mode = mount.split(":")
            assert target.startswith("/")
            if source.startswith("."):
                assert mode == ["ro"], f"{name}: {mount}"
                there = (root / "deploy" / source).exists()
                not_merged = source.startswith(ELSEWHERE) and not (root / "deploy" / source.split("/")[1]).exists()
                assert there or not_merged, mount
            else:
                assert source in compose["volumes"], f"{name}: {mount}"


def test_a_camera_has_the_hosts_name_by_which_the_station_finds_it(root):
    (line,) = re.findall(r"#   devices: (\[.*\])", (root / "deploy/compose.yaml").read_text())
    cameras = [each.split(":") for each in yaml.safe_load(line) if "video" in each]
    assert [host for host, _ in cameras] == [container for _, container in cameras] != []


def test_who_backs_up_a_container_is_said(compose, root):
    section = (root / "docs/deployment.md").read_text().partition("\n## Containers\n")[2].partition("\n## ")[0]
    assert not any("backup" in name for name in compose["services"])
    assert re.search(
        r"station records backup [^\n]+ &&\n +docker compose .* touch /var/lib/fruit-station/last_backup", section
    )


def test_only_the_line_and_the_operators_are_let_in_and_from_loopback_unless_said(compose):
    published = {name: service["ports"] for name, service in compose["services"].items() if "ports" in service}
    assert published.keys() == {"station", "grafana"}
    for port in (port for ports in published.values() for port in ports):
        assert re.fullmatch(r"\$\{(LINE|OPERATORS)_ADDRESS:-127\.0\.0\.1\}:\d+:\d+", port)
    networks = {name: set(service.get("networks", ())) for name, service in compose["services"].items()}
    assert compose["networks"].keys() == set.union(*networks.values())
    assert networks["postgresql"] == {"archive"}
    assert not networks["prometheus"] & {"cell", "line", "archive"}
    assert not networks["grafana"] & {"cell", "line"}
    assert all(compose["networks"][name] == {"internal": True} for name in ("archive", "monitoring"))


def test_the_image_takes_the_locks_by_their_hashes_and_is_nobody(root):
    text = (root / "deploy/Containerfile").read_text()
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    bases = [line.split()[1] for line in lines if line.startswith("FROM")]
    assert len(bases) == 2
    assert len(set(bases)) == 1
    assert re.search(r":3\.11\.\d+-slim-bookworm$", bases[0])
    assert "pip install --require-hashes --no-deps -r requirements-build.lock -r requirements.lock" in text
    assert "USER 990:990" in lines
    assert 'ENTRYPOINT ["tini", "--", "station"]' in lines
    assert "HEALTHCHECK" in text
    copied = {line.split()[1] for line in lines if line.startswith("COPY") and "--from" not in line}
    project = tomllib.loads((root / "pyproject.toml").read_text())
    assert set(project["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]) <= copied
    assert all((root / name).exists() for name in copied)
    let_in = {
        line[1:] for line in (root / "deploy/Containerfile.dockerignore").read_text().split() if line.startswith("!")
    }
    assert copied <= let_in | {"requirements-build.lock"}


def test_the_version_is_the_projects(compose, root):
    project = tomllib.loads((root / "pyproject.toml").read_text())["project"]
    assert compose["services"]["station"]["image"] == f"fruit-station:{project['version']}"


def test_logins_are_of_the_groups_that_the_schema_has(root):
    schema = (root / "deploy/postgresql/schema.sql").read_text()
    logins = re.findall(r"^login (\w+) (\w+) (\w+)$", (root / "deploy/containers/roles.sh").read_text(), re.MULTILINE)
    assert len(logins) == 2
    for _, group, _ in logins:
        assert re.search(rf"CREATE ROLE {group}\b", schema), group
    subprocess.run(["sh", "-n", root / "deploy/containers/roles.sh"], check=True)

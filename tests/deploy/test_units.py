"""Units, users, folders and device rules, as systemd and udev read them."""

import configparser
import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from station.settings.service import ServiceSettings
from station.supervision import notify
from station.supervision.programs import station_programs
from tests.tools import optional

MOST_EXPOSED = 2.5
UNITS = ("fruit-station.service", "fruit-station-backup.service", "fruit-station-backup.timer")
TERM = re.compile(r'(?P<key>[A-Z]+(?P<sub>\{[A-Za-z_/]+\})?)(?P<operator>==|!=|\+=|=)"(?P<value>[^"]*)"')
MATCHES = {"SUBSYSTEM", "SUBSYSTEMS", "ACTION", "DRIVER", "KERNEL", "ATTR", "ATTRS", "ENV", "TEST"}
ASSIGNS = {"SYMLINK", "GROUP", "MODE", "ATTR", "ENV", "TAG", "OWNER"}


@pytest.fixture
def booted(tmp_path, root) -> Path:
    """A root in which the units are, and what they start."""
    units = tmp_path / "etc/systemd/system"
    units.mkdir(parents=True)
    for name in UNITS:
        shutil.copy(root / "deploy/systemd" / name, units)
    programs = tmp_path / "opt/fruit-station/current/venv/bin"
    programs.mkdir(parents=True)
    tools = tmp_path / "usr/bin"
    tools.mkdir(parents=True)
    for program in (programs / "station", programs / "python", tools / "systemd-tmpfiles"):
        program.write_text("#!/bin/sh\n")
        program.chmod(0o755)
    for target in Path("/usr/lib/systemd/system").glob("*.target"):
        (units / target.name).symlink_to(target)
    return tmp_path


def unit(root: Path, name: str) -> dict[str, dict[str, list[str]]]:
    """A unit's settings, each with all its values."""
    found: dict[str, dict[str, list[str]]] = {}
    section = ""
    for line in (root / "deploy/systemd" / name).read_text().splitlines():
        if line.startswith("["):
            section = line.strip("[]")
        elif line and not line.startswith("#"):
            key, _, value = line.partition("=")
            found.setdefault(section, {}).setdefault(key, []).append(value)
    return found


def seconds(text: str) -> float:
    return sum(
        float(number) * {"": 1, "s": 1, "min": 60, "h": 3600}[what]
        for number, what in re.findall(r"(\d+)\s*(\w*)", text)
    )


def test_systemd_finds_nothing_wrong_with_the_units(booted):
    units = [booted / "etc/systemd/system" / name for name in UNITS]
    paths = [f"/{path.relative_to(booted)}" for path in units]
    command = [optional("systemd-analyze"), "verify", f"--root={booted}", "--man=no", "--recursive-errors=no", *paths]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("name", [name for name in UNITS if name.endswith(".service")])
def test_what_a_unit_may_is_little(root, name):
    options = ("security", "--offline=true", "--no-pager", f"--threshold={10 * MOST_EXPOSED:g}")
    command = [optional("systemd-analyze"), *options, root / "deploy/systemd" / name]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    found = re.search(r"Overall exposure level for \S+: ([0-9.]+)", done.stdout)
    assert found, done.stdout + done.stderr
    assert float(found[1]) <= MOST_EXPOSED
    assert done.returncode == 0


@pytest.mark.parametrize("name", [name for name in UNITS if name.endswith(".service")])
def test_a_unit_makes_itself_what_it_may_write(root, name):
    """A folder of `ReadWritePaths` that is missing, as on a disk mounted over its parent, keeps a unit from running."""
    service = unit(root, name)["Service"]
    made = (root / "deploy/tmpfiles.d/fruit-station.conf").read_text()
    for path in " ".join(service.get("ReadWritePaths", [])).split():
        assert f"\nd {path} " in made
        # Only this folder: a site may have given another one other rights.
        makes = f"-+/usr/bin/systemd-tmpfiles --create --prefix={path} fruit-station.conf"
        assert makes in service["ExecStartPre"]


def test_the_units_times_leave_room_for_what_the_supervisor_mends_itself(root):
    service = unit(root, "fruit-station.service")["Service"]
    limits = ServiceSettings.model_fields["clean_up_deadline_s"].metadata
    longest_s = next(limit.le for limit in limits if hasattr(limit, "le"))
    programs = station_programs(None, outbox=True, clean_up_s=longest_s)
    slowest_start_s = max(each.start_limit_s for each in programs)
    assert service["Type"] == ["notify"]
    assert seconds(service["WatchdogSec"][0]) > max(each.watchdog_s for each in programs) + 2 * slowest_start_s
    assert seconds(service["TimeoutStartSec"][0]) > sum(each.start_limit_s for each in programs)
    assert seconds(service["TimeoutStopSec"][0]) > sum(each.stop_limit_s for each in programs)


def test_the_installer_waits_as_long_as_the_unit_may_take(root, installer):
    service, services = unit(root, "fruit-station.service")["Service"], installer("services")
    longest_s = seconds(service["TimeoutStartSec"][0]) + notify._EXTENDED_LONGEST_S
    assert longest_s < services._START_LIMIT_S
    assert seconds(service["TimeoutStopSec"][0]) < services._STOP_LIMIT_S


def test_a_device_that_is_plugged_in_later_is_allowed_too(root):
    """Before a kind's module is loaded /proc/devices does not have it, and systemd ignores its DeviceAllow."""
    found = unit(root, "fruit-station.service")
    module = {"char-video4linux": "videodev", "char-ttyUSB": "usbserial", "char-ttyACM": "cdc_acm"}
    needed = {f"modprobe@{module[each.split()[0]]}.service" for each in found["Service"]["DeviceAllow"]}
    for key in ("Wants", "After"):
        assert needed <= {name for value in found["Unit"][key] for name in value.split()}


def test_the_station_is_started_again_without_end(root):
    """The address of a switch that boots slower than this machine comes after any number of starts."""
    found = unit(root, "fruit-station.service")
    assert found["Unit"]["StartLimitIntervalSec"] == ["0"]
    assert found["Service"]["Restart"] == ["on-failure"]
    assert 5 <= seconds(found["Service"]["RestartSec"][0]) <= 30


def test_the_station_keeps_what_it_needs(root):
    service = unit(root, "fruit-station.service")["Service"]
    assert {"char-video4linux rw", "char-ttyUSB rw", "char-ttyACM rw"} == set(service["DeviceAllow"])
    assert set(service["SupplementaryGroups"][0].split()) == {"dialout", "video"}
    assert service["LimitRTPRIO"] == ["1"]
    assert service["RestrictRealtime"] == ["no"]
    assert "sched_setscheduler" in service["SystemCallFilter"][-1]
    assert {"AF_UNIX", "AF_INET", "AF_INET6", "AF_CAN"} <= set(service["RestrictAddressFamilies"][0].split())
    assert service["User"] == ["fruit-station"]


def test_the_backup_finds_what_the_station_has(root):
    backup, service = (unit(root, name)["Service"] for name in UNITS[1::-1])
    for what in ("User", "Environment", "StateDirectory"):
        assert set(backup[what]) <= set(service[what])
    assert (root / "deploy/backup").stat().st_mode & 0o100
    timer = configparser.ConfigParser(interpolation=None)
    timer.read(root / "deploy/systemd" / UNITS[2])
    assert timer["Timer"]["Persistent"] == "yes"


@pytest.mark.parametrize(("command", "groups"), [("support", "-g fruit-station -G systemd-journal "), ("records", "")])
def test_only_the_support_bundle_of_an_installed_station_reads_the_journal(tmp_path, root, command, groups):
    for name, does in {"id": "echo root", "runuser": 'echo "$@"'}.items():
        (tmp_path / name).write_text(f"#!/bin/sh\n{does}\n")
        (tmp_path / name).chmod(0o755)
    environment = {"PATH": f"{tmp_path}:{os.environ['PATH']}"}
    called = [root / "deploy/command/station", command, "--help"]
    done = subprocess.run(called, env=environment, capture_output=True, text=True, check=True)
    program = "/opt/fruit-station/current/venv/bin/station"
    assert done.stdout == f"-u fruit-station {groups}-- {program} {command} --help\n"


def test_the_calendar_is_one(root):
    when = unit(root, UNITS[2])["Timer"]["OnCalendar"][0]
    subprocess.run([optional("systemd-analyze"), "calendar", when], check=True, capture_output=True)


def test_users_and_folders_are_made(tmp_path, root):
    if os.geteuid() != 0:
        pytest.skip("only root makes users")
    for kind in ("sysusers.d", "tmpfiles.d"):
        shutil.copytree(root / "deploy" / kind, tmp_path / "etc" / kind)
    for name, content in {"passwd": "", "group": "dialout:x:20:\nvideo:x:44:\n", "shadow": "", "gshadow": ""}.items():
        (tmp_path / "etc" / name).write_text(content)
    for _ in range(2):
        for program in ("systemd-sysusers", "systemd-tmpfiles"):
            options = ["--create"] if program == "systemd-tmpfiles" else []
            done = subprocess.run(
                [optional(program), f"--root={tmp_path}", *options, "fruit-station.conf"],
                capture_output=True,
                text=True,
                check=False,
            )
            assert done.returncode == 0, done.stderr
    uid = int(
        next(line for line in (tmp_path / "etc/passwd").read_text().splitlines() if "fruit" in line).split(":")[2]
    )
    folders = {
        name: (tmp_path / name).stat()
        for name in ("etc/fruit-station", "var/lib/fruit-station", "var/backups/fruit-station")
    }
    assert {name: oct(found.st_mode & 0o777) for name, found in folders.items()} == dict.fromkeys(folders, "0o750")
    assert [found.st_uid for found in folders.values()] == [0, uid, uid]
    (tmp_path / "etc/fruit-station").chmod(0o770)  # as the page Configuration needs it
    (tmp_path / "var/backups/fruit-station").rmdir()
    options = [f"--root={tmp_path}", "--create", "--prefix=/var/backups/fruit-station"]
    subprocess.run([optional("systemd-tmpfiles"), *options, "fruit-station.conf"], check=True)
    assert (tmp_path / "var/backups/fruit-station").stat().st_uid == uid
    assert (tmp_path / "etc/fruit-station").stat().st_mode & 0o777 == 0o770


def rule_lines(root: Path) -> list[str]:
    text = (root / "deploy/udev/70-fruit-station.rules").read_text()
    return [line for line in text.splitlines() if line and not line.startswith("#")]


def test_udev_reads_every_rule(root):
    lines = rule_lines(root)
    assert len(lines) == 4
    for line in lines:
        terms = [TERM.fullmatch(term) for term in re.split(r",\s*", line)]
        assert all(terms), f"no rule: {line}"
        for term in terms:
            assert term
            key = term["key"].partition("{")[0]
            assert key in (MATCHES if term["operator"] in {"==", "!="} else ASSIGNS), term[0]
            assert term["operator"] != "==" or term["value"], term[0]
    verifier = shutil.which("udevadm")
    if (
        verifier
        and "verify" in subprocess.run([verifier, "--help"], capture_output=True, text=True, check=False).stdout
    ):
        subprocess.run([verifier, "verify", root / "deploy/udev/70-fruit-station.rules"], check=True)


def test_devices_have_names_by_their_serial_numbers(root):
    sensor, awake, adapter, latency = rule_lines(root)
    assert 'ATTRS{idVendor}=="2833", ATTRS{idProduct}=="0209"' in sensor
    assert 'SYMLINK+="digit/$env{ID_SERIAL_SHORT}"' in sensor
    assert 'ATTR{power/control}="on"' in awake
    assert 'SYMLINK+="rs485/$env{ID_SERIAL_SHORT}"' in adapter
    assert 'ATTR{latency_timer}="1"' in latency
    groups = unit(root, UNITS[0])["Service"]["SupplementaryGroups"][0].split()
    assert set(re.findall(r'GROUP="(\w+)"', "\n".join(rule_lines(root)))) == set(groups)

"""Promises about the repository itself: locks, packaging, links, the run script."""

import importlib.machinery
import importlib.metadata
import importlib.util
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
LOCKS = ("requirements-build.lock", "requirements.lock", "requirements-dev.lock")
PIN = re.compile(r"^(?P<name>[a-z0-9._-]+)==(?P<version>[^ ;]+)", re.MULTILINE)


def pins(lock: str) -> dict[str, str]:
    return {match["name"]: match["version"] for match in PIN.finditer((ROOT / lock).read_text())}


def tracked(*patterns: str) -> list[Path]:
    done = subprocess.run(["git", "ls-files", "-z", *patterns], cwd=ROOT, capture_output=True, text=True, check=True)
    return [ROOT / name for name in done.stdout.split("\0") if name and (ROOT / name).is_file()]


def test_the_developers_lock_holds_what_ships_in_the_same_versions():
    developer = pins("requirements-dev.lock")
    for lock in LOCKS[:2]:
        assert pins(lock)
        assert {name: developer.get(name) for name in pins(lock)} == pins(lock)


def test_the_locks_satisfy_the_project():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    groups = project["dependency-groups"]
    wanted = {
        "requirements-build.lock": groups["build"],
        "requirements.lock": project["project"]["dependencies"],
        "requirements-dev.lock": groups["dev"],
    }
    for lock, requirements in wanted.items():
        locked = pins(lock)
        for text in requirements:
            requirement = Requirement(text)
            assert requirement.specifier.contains(locked[canonicalize_name(requirement.name)]), f"{text} in {lock}"


@pytest.mark.parametrize("lock", ["requirements.lock", "requirements-dev.lock"])
def test_a_lock_lists_what_its_packages_need_as_it_is_installed_without_looking_for_that(lock):
    pinned = pins(lock)
    wanting = []
    for name in pinned:
        for text in importlib.metadata.distribution(name).requires or []:
            needed = Requirement(text)
            if needed.marker is not None and not needed.marker.evaluate({"extra": ""}):
                continue
            version = pinned.get(canonicalize_name(needed.name))
            if version is None or version not in needed.specifier:
                wanting.append(f"{name} needs {needed}, {version} is listed")
    assert wanting == []
    assert len(pinned) > 30


@pytest.mark.parametrize("lock", [*LOCKS, "benchmarks/hmi_load/nicegui.lock"])
def test_a_lock_has_hashes_and_no_address(lock):
    text = (ROOT / lock).read_text()
    assert "://" not in text
    assert all(" \\\n    --hash=sha256:" in block for block in re.split(r"\n(?=[a-z])", text.strip()))


def test_the_readmes_figures_are_those_that_the_benchmark_wrote():
    lines = (ROOT / "README.md").read_text().splitlines()
    rows = [line for line in lines if line.startswith(("| `paper`", "| `robust`"))]
    assert len(rows) == 4
    measured = (ROOT / "docs" / "measurement.md").read_text().splitlines()
    assert [row for row in rows if row not in measured] == []


def test_the_wheel_holds_what_the_program_reads(tmp_path):
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True, timeout=60)
    (wheel,) = tmp_path.glob("fruit_station-*.whl")
    shipped = set(zipfile.ZipFile(wheel).namelist())
    data = tracked("station", "recipes", "plc_interface", "hmi")
    assert {str(path.relative_to(ROOT)) for path in data} <= shipped


@pytest.mark.parametrize(("arguments", "code"), [(["--help"], 0), ([], 0), (["brew"], 2)])
def test_the_run_script_needs_only_the_standard_library(arguments, code):
    command = [sys.executable, "-I", "-S", str(ROOT / "run"), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=20, check=False)
    assert done.returncode == code
    assert "./run COMMAND" in done.stdout + done.stderr
    assert "Traceback" not in done.stderr


@pytest.fixture
def run_script():
    """The script `run` as a module."""
    loader = importlib.machinery.SourceFileLoader("run_script", str(ROOT / "run"))
    spec = importlib.util.spec_from_loader(loader.name, loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    loader.exec_module(module)
    return module


def test_a_python_without_packages_is_refused_before_anything_is_installed(run_script, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(sys, "version_info", (3, 13, 0))
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setattr(run_script.shutil, "which", lambda _name: None)
    with pytest.raises(SystemExit):
        run_script.use_a_supported_python()
    assert "uv python install 3.12" in capsys.readouterr().err


def test_another_python_of_the_machine_goes_on(run_script, monkeypatch):
    started, this = [], f"python{sys.version_info.major}.{sys.version_info.minor}"
    monkeypatch.setattr(sys, "version_info", (3, 13, 0))
    monkeypatch.setattr(run_script.shutil, "which", lambda name: sys.executable if name == this else None)
    monkeypatch.setattr(run_script.os, "execv", lambda *command: started.append(command) or sys.exit(0))
    monkeypatch.setattr(sys, "argv", ["run", "demo", "--count", "3"])
    with pytest.raises(SystemExit):
        run_script.use_a_supported_python()
    assert started == [(sys.executable, [sys.executable, str(ROOT / "run"), "demo", "--count", "3"])]

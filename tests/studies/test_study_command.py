"""`station study`: its files, its resuming, and what it refuses."""

import csv
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

import station
from station.commands.study import study
from station.errors import BadInputError
from station.studies.folder import StudyFolder, identity_of
from station.studies.sample import Task, measure_sample
from station.studies.study import Request, run_study

DEADLINE_S = 280
ARGUMENTS = ("--fruit", "blueberry", "--seed", "5", "--method", "robust")
TASK = Task("blueberry", "robust", 5, 1)

pytestmark = pytest.mark.timeout(600)


def run_command(*arguments: object) -> Result:
    """Run the command in this process, without its signal's handler."""
    before = signal.getsignal(signal.SIGTERM)
    try:
        return CliRunner().invoke(study, [str(one) for one in (*ARGUMENTS, *arguments)])
    finally:
        signal.signal(signal.SIGTERM, before)


def request(out: Path, samples: int) -> Request:
    return Request("blueberry", samples, 5, "robust", out, 1)


def test_a_study_on_two_cores_writes_its_files(tmp_path: Path):
    out = tmp_path / "new" / "study"
    command = [sys.executable, "-m", "station", "study", *ARGUMENTS, "--samples", "2", "--jobs", "2", "--out", str(out)]
    found = subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE_S, check=False)
    assert found.returncode == 0, found.stderr
    assert "of 2 samples failed" in found.stdout
    summary = json.loads((out / "summary.json").read_text())
    assert (summary["fruit"], summary["method"], summary["samples"]) == ("blueberry", "robust", 2)
    assert summary["failure_rate"] == summary["failures"] / 2
    assert len(summary["failed_samples"]) == summary["failures"]
    low, high = summary["failure_rate_95"]
    assert low <= summary["failure_rate"] <= high
    curves = list(csv.DictReader((out / "curves.csv").read_text().splitlines()))
    assert [row["sample"] for row in curves] == ["1"] * 20 + ["2"] * 20
    assert set(summary["failed_samples"]) <= {1, 2}
    assert {path.name for path in (out / "samples").iterdir()} == {"00001.json", "00002.json"}
    page = (out / "report.html").read_text()
    assert "26.7%" in page
    assert page.count("data:image/") >= 4
    assert "http" not in page
    folder = StudyFolder(out, identity_of(TASK))
    alone = [measure_sample(TASK._replace(number=number)) for number in (1, 2)]
    assert [folder.stored(number) for number in (1, 2)] == alone


def test_what_is_stored_is_not_measured_again_and_what_is_torn_is(tmp_path: Path):
    folder = StudyFolder(tmp_path, identity_of(TASK))
    whole = measure_sample(TASK)
    folder.store(whole.model_copy(update={"weight_g": 99.0}))
    folder.store(whole.model_copy(update={"number": 2}))
    torn = tmp_path / "samples" / "00002.json"
    torn.write_bytes(torn.read_bytes()[:40])
    there: list[int] = []
    done = run_study(request(tmp_path, 2), there.append, lambda: there.append(1))
    assert there == [1, 1]
    assert done.samples[0].weight_g == 99.0
    assert done.samples[1] == measure_sample(TASK._replace(number=2))
    assert folder.stored(2) == done.samples[1]


@pytest.mark.parametrize("name", ["paper", "methods", "median", "contact", "working", "step", "press", "robust"])
def test_a_study_is_another_one_where_the_code_that_measures_it_is_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
):
    """Without the code of `robust` a sample by `paper` is measured as before."""
    for folder in ("studies", "twin", "vision"):
        shutil.copytree(Path(station.__file__).parent / folder, tmp_path / folder)
    monkeypatch.setattr(station, "__file__", str(tmp_path / "__init__.py"))
    tasks = [TASK._replace(method=method) for method in ("paper", "robust")]
    before = [identity_of(task) for task in tasks]
    with (tmp_path / "vision" / f"{name}.py").open("a") as file:
        file.write("# another line\n")
    paper, robust = (identity_of(task) == same for task, same in zip(tasks, before, strict=True))
    assert (paper, robust) == (name == "robust", False)


def test_an_interrupted_study_keeps_what_it_measured(tmp_path: Path):
    out = tmp_path / "out"
    command = [
        sys.executable,
        "-m",
        "station",
        "study",
        *ARGUMENTS,
        "--samples",
        "400",
        "--jobs",
        "2",
        "--out",
        str(out),
    ]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, start_new_session=True)
    deadline = time.monotonic() + DEADLINE_S
    while not list(out.glob("samples/0*.json")):
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)
    _, output = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 130
    assert "the same command goes on from there" in output
    assert "Traceback" not in output
    stored = list((out / "samples").iterdir())
    assert stored
    assert all(json.loads(path.read_bytes())["areas_px"] for path in stored)
    assert not (out / "summary.json").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--fruit", "kiwi"), "'kiwi' is not one of"),
        (("--samples", 0), "0 is not in the range"),
        (("--samples", "many"), "not a valid integer"),
        (("--samples", 10**9), "is not in the range"),
        (("--method", "magic"), "'magic' is not one of"),
        (("--seed", -1), "is not in the range"),
        (("--jobs", 0), "is not in the range"),
    ],
)
def test_bad_usage_is_told(tmp_path: Path, arguments: tuple[object, ...], message: str):
    found = run_command("--samples", 1, "--out", tmp_path / "out", *arguments)
    assert found.exit_code == 2
    assert message in found.output
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("label", "message"),
    [
        (
            {"fruit": "strawberry", "method": "paper"},
            "fruit strawberry in place of blueberry, method paper in place of",
        ),
        ({"seed": 6, "method": "paper", "measured_by": "0"}, "method paper in place of robust, seed 6 in place of 5)"),
        ({}, "another version of the program"),
        ({"seed": "five"}, "is not a study's"),
    ],
)
def test_another_study_s_folder_is_refused(tmp_path: Path, label: dict[str, object], message: str):
    whole = {"fruit": "blueberry", "method": "robust", "seed": 5, "measured_by": "0", **label}
    (tmp_path / "study.json").write_text(json.dumps(whole))
    with pytest.raises(BadInputError, match="name a new folder") as refusal:
        run_study(request(tmp_path, 1), lambda _: None, lambda: None)
    assert message in str(refusal.value)
    assert [path.name for path in tmp_path.iterdir()] == ["study.json"]


def test_a_folder_that_cannot_be_used_is_refused(tmp_path: Path):
    file = tmp_path / "file"
    file.touch()
    for out in (file, file / "below", Path("/proc/study")):
        found = run_command("--samples", 1, "--out", out)
        assert isinstance(found.exception, BadInputError)
        assert "name another folder" in str(found.exception)
    found = run_command("--samples", 1, "--out", tmp_path)
    assert "holds no study" in str(found.exception)


def test_a_disk_that_is_full_leaves_nothing_half_written(tmp_path: Path):
    """A limit on the size of files simulates the full disk: a sample takes more than 512 bytes, the label less."""
    out = tmp_path / "out"
    command = [sys.executable, "-B", "-m", "station", "study", *ARGUMENTS, "--samples", "1", "--out", str(out)]

    def limited() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (512, 512))

    found = subprocess.run(
        command,
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
        check=False,
        preexec_fn=limited,
    )
    assert found.returncode == 1
    assert "File too large" in found.stderr
    assert "what was measured by then is kept" in found.stderr
    assert "Traceback" not in found.stderr
    assert list((out / "samples").iterdir()) == []


def test_a_cluster_that_is_not_there_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    found = run_command("--samples", 1, "--out", tmp_path / "a", "--scheduler", "tcp://127.0.0.1:1")
    assert isinstance(found.exception, BadInputError)
    assert "pip install 'fruit-station[cluster]'" in str(found.exception)

"""`station study --scheduler`: the same cohort on a cluster of processes."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from station.studies.sample import SampleResult, Task, measure_sample

ARGUMENTS = ("--fruit", "raspberry", "--samples", "2", "--seed", "2", "--method", "robust")
DEADLINE_S = 280

pytestmark = pytest.mark.timeout(600)


@pytest.fixture
def scheduler() -> Iterator[str]:
    """The address of a cluster of two processes."""
    script = Path(__file__).with_name("local_cluster.py")
    cluster = subprocess.Popen([sys.executable, str(script)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert cluster.stdout is not None
    assert cluster.stdin is not None
    try:
        yield cluster.stdout.readline().strip()
    finally:
        cluster.stdin.close()
        cluster.wait(DEADLINE_S)
        cluster.stdout.close()


def study(out: Path, address: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "station", "study", *ARGUMENTS, "--out", str(out), "--scheduler", address]
    return subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE_S, check=False)


def test_a_cluster_gives_the_same_samples(scheduler: str, tmp_path: Path):
    out = tmp_path / "out"
    found = study(out, scheduler)
    assert found.returncode == 0, found.stderr
    assert "of 2 samples failed" in found.stdout
    for number in range(2):
        stored = SampleResult.model_validate_json((out / "samples" / f"{number:05d}.json").read_bytes())
        assert stored == measure_sample(Task("raspberry", "robust", 2, number))


def test_an_address_where_nobody_answers_is_told(unused_port: int, tmp_path: Path):
    found = study(tmp_path / "out", f"tcp://127.0.0.1:{unused_port}")
    assert found.returncode == 2
    assert "no Dask scheduler answers there" in found.stderr
    assert "Traceback" not in found.stderr

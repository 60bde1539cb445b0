"""`station study --scheduler`: the same cohort on a cluster of processes."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from station.dask_client import connect
from station.errors import BadInputError

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


def study(out: Path, *where: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "station", "study", *ARGUMENTS, "--out", str(out), *where]
    return subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE_S, check=False)


def test_a_cluster_gives_the_same_samples(scheduler: str, tmp_path: Path):
    there, here = tmp_path / "there", tmp_path / "here"
    for found in (study(there, "--scheduler", scheduler), study(here, "--jobs", "1")):
        assert found.returncode == 0, found.stderr
        assert "of 2 samples failed" in found.stdout
    for name in ("00001.json", "00002.json"):
        assert (there / "samples" / name).read_bytes() == (here / "samples" / name).read_bytes()


def test_an_address_where_nobody_answers_is_told(unused_port: int, tmp_path: Path):
    found = study(tmp_path / "out", "--scheduler", f"tcp://127.0.0.1:{unused_port}")
    assert found.returncode == 2
    assert "no Dask scheduler answers there" in found.stderr
    assert "Traceback" not in found.stderr


def test_a_closed_port_is_refused_before_dasks_client_would_retry_it(unused_port: int, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("distributed.Client", lambda *_, **__: pytest.fail("it retries for ten seconds"))
    with pytest.raises(BadInputError, match="no Dask scheduler answers there"):
        connect(f"tcp://127.0.0.1:{unused_port}")


def test_a_worker_that_dask_started_does_not_map_each_image_anew():
    script = (
        "import resource; from station.studies.sample import Task; from station.studies.workers import "
        "measure_on_cluster as work\n"
        "for _ in range(2):\n"
        "    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt\n"
        "    work(Task('raspberry', 'robust', 2, 1))\n"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)"
    )
    environment = {**os.environ, "MALLOC_TRIM_THRESHOLD_": "65536"}  # as distributed.nanny sets it
    found = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, env=environment)
    assert int(found.stdout) < 20_000, "page faults; 551 were measured, and 406,082 with what Dask sets"


def test_a_matrix_is_multiplied_on_one_thread_so_that_the_number_of_cores_changes_no_sum():
    script = (
        "import station, numpy, threadpoolctl; print([pool['num_threads'] for pool in threadpoolctl.threadpool_info()])"
    )
    environment = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    found = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, env=environment)
    assert found.stdout.strip() == "[1]"

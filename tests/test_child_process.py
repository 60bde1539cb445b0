"""Child processes that end with the one that started them."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import psutil
import pytest

from tests.eventually import eventually

STARTER = """
import os, sys
from station.child_process import worker_processes

if __name__ == "__main__":
    pool = worker_processes(2)
    for _ in range(2):
        print(pool.submit(os.getpid).result(), flush=True)
        sys.stdin.readline()
"""


@pytest.fixture
def starter(tmp_path):
    """Give a process with a worker, and the worker."""
    script = tmp_path / "starter.py"
    script.write_text(STARTER)
    with subprocess.Popen(
        [sys.executable, script],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parents[1])},
    ) as process:
        assert process.stdout
        yield process, psutil.Process(int(process.stdout.readline()))
        process.kill()


def test_a_worker_ends_with_a_starter_that_is_killed(starter):
    process, worker = starter
    process.kill()
    process.wait()
    eventually(lambda: not worker.is_running() or worker.status() == psutil.STATUS_ZOMBIE)


def test_a_worker_leaves_ctrl_c_to_its_starter(starter):
    process, worker = starter
    worker.send_signal(signal.SIGINT)
    process.stdin.write("\n")
    process.stdin.flush()
    assert int(process.stdout.readline()) == worker.pid

"""Child processes that end with the one that started them, also where that is killed."""

import ctypes
import multiprocessing
import os
import signal
import sys
from concurrent.futures import ProcessPoolExecutor

_PR_SET_PDEATHSIG = 1
"""prctl(2)."""


def end_with(parent: int) -> None:
    """Have the kernel kill this process when the one that started it ends; elsewhere than on Linux do nothing.

    Args:
        parent: process id of the starter; the present parent has another one if the starter has ended.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:
            os._exit(1)


def worker_processes(number: int) -> ProcessPoolExecutor:
    """Make a pool of workers, started as tasks come, that leave Ctrl-C to this process and end with it.

    They are spawned, since OpenCV's threads do not survive a fork. Linux ends them with the thread that gives the
    tasks: it has to live as long as they do.
    """
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(number, context, initializer=_serve, initargs=(os.getpid(),))


def _serve(parent: int) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with(parent)

"""Workers of a study: processes on this machine, or a Dask cluster.

A sample's numbers depend on its task alone, so neither the place nor the number of workers changes them.
"""

import multiprocessing
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import NoReturn, TypeVar

from station.child_process import worker_processes
from station.dask_client import connect
from station.errors import BadInputError, StationError
from station.memory import keep_freed_memory
from station.studies.folder import identity_of
from station.studies.sample import SampleResult, Task, measure_sample

One = TypeVar("One")
Answer = TypeVar("Answer")


def on_this_machine(work: Callable[[One], Answer], tasks: Sequence[One], jobs: int) -> Iterator[Answer]:
    """Work in processes of this machine; they end with the iteration.

    Args:
        work: function of a module, applied to each task.
        jobs: number of processes, at least 1.

    Yields:
        The answers in order of completion.

    Raises:
        StationError: a process was killed from outside, as by a lack of memory.
    """
    if jobs == 1 or len(tasks) < 2:
        yield from map(work, tasks)
        return
    with worker_processes(min(jobs, len(tasks))) as pool:
        try:
            for future in as_completed([pool.submit(work, task) for task in tasks]):
                yield future.result()
        except BrokenProcessPool as error:
            raise StationError(
                "a process that measured was killed; give the same command again, with fewer --jobs if memory was short"
            ) from error
        except BaseException:
            # This cancels only tasks that have not begun, so the processes of the others are ended.
            pool.shutdown(wait=False, cancel_futures=True)
            for process in multiprocessing.active_children():
                process.terminate()
            raise


def stop_on_sigterm() -> None:
    """Let SIGTERM end this process as Ctrl-C does, so that its workers end with it."""

    def interrupt(_number: int, _frame: object) -> NoReturn:
        raise KeyboardInterrupt

    signal.signal(signal.SIGTERM, interrupt)


def on_cluster(tasks: Sequence[Task], address: str) -> Iterator[SampleResult]:
    """Measure on a Dask cluster with the same version of this program, at an address such as `tcp://10.0.0.5:8786`.

    Raises:
        BadInputError: Dask is not installed here, or the address does not answer.
        StationError: the cluster failed while it measured.
    """
    with connect(address) as client:
        _check_workers(client, address, tasks[0])
        yield from _gathered(client, tasks)


def measure_on_cluster(task: Task) -> SampleResult:
    """Measure a sample in a Dask worker, which is started so that every image's memory is mapped anew (twice the time).

    Its nanny sets `MALLOC_TRIM_THRESHOLD_`; a worker may join at any time, so each task undoes that.
    """
    keep_freed_memory()
    return measure_sample(task)


def _check_workers(client, address: str, task: Task) -> None:  # noqa: ANN001 (of an optional library)
    """Refuse a cluster without workers, or whose workers would measure differently from this program."""
    try:
        identities = client.run(identity_of, task)
    except Exception as error:
        raise BadInputError(
            f"--scheduler {address}: a worker does not have this program ({error}); install the same version of "
            "fruit-station there"
        ) from error
    if not identities:
        raise BadInputError(f"--scheduler {address}: it has no worker; start some with: dask worker {address}")
    others = [worker for worker, identity in identities.items() if identity != identity_of(task)]
    if others:
        raise BadInputError(
            f"--scheduler {address}: {others[0]} has another version of the program or the recipe; install the same "
            "version of fruit-station there"
        )


def _gathered(client, tasks: Sequence[Task]) -> Iterator[SampleResult]:  # noqa: ANN001 (of an optional library)
    import distributed  # noqa: PLC0415 (an optional extra, and slow to import)

    futures = client.map(measure_on_cluster, tasks, pure=False, retries=2)
    try:
        for future in distributed.as_completed(futures):
            yield future.result()
    except Exception as error:
        raise StationError(
            f"the cluster failed: {error}; what was measured by then is kept: give the same command again"
        ) from error
    finally:
        client.cancel(futures, force=True)

"""Writer thread: takes all waiting requests, and makes them durable with one commit."""

import contextlib
import queue
import threading
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

from sqlalchemy import Connection

from station.messages import records as messages
from station.messages.message import Message
from station.records.error_mapping import map_error
from station.records.errors import (
    DamagedError,
    DiskError,
    DiskFullError,
    LockedError,
    ReadOnlyError,
    RecordsClosedError,
    RecordsError,
)

T = TypeVar("T")
Work = Callable[[Connection], T]
"""Part of the transaction, run in the writer's thread. It may raise a `RecordsError`."""

LARGEST_BATCH = 128
"""Requests in one commit at most; an estimate."""
CONCERNING_ALL = (DiskFullError, ReadOnlyError, DiskError, LockedError, DamagedError)
"""Faults of the disk or the file, which roll back the whole transaction."""


class Writer:
    """Runs requests on one connection, in the order in which they came."""

    def __init__(
        self,
        connect: Callable[[], Connection],
        before_commit: Callable[[Connection], None],
        after_commit: Callable[[], None],
        place: str,
        failures: Counter[str],
    ) -> None:
        """Start the thread.

        Args:
            connect: called in the thread, again after each failure.
            before_commit: called in each transaction after its requests; if it raises, all of them fail.
            after_commit: called after each commit's answers; never raises.
            place: the database's path, for messages.
            failures: counts the requests that failed, by the code of their error.

        Raises:
            RecordsError: no connection could be made.
        """
        self.writes = 0
        self.last_write_s: float | None = None
        self.error: Message | None = None
        self._connect = connect
        self._connection: Connection | None = None
        self._before_commit, self._after_commit = before_commit, after_commit
        self._place, self._failures = place, failures
        self._queue: queue.SimpleQueue[tuple[Work[Any], Future[Any]] | None] = queue.SimpleQueue()
        self._closed = False
        self._gate = threading.Lock()
        opened: Future[None] = Future()
        self._thread = threading.Thread(target=self._run, args=(opened,), name="records-writer", daemon=True)
        self._thread.start()
        opened.result()

    @property
    def waiting(self) -> int:
        """Return the number of waiting requests."""
        return self._queue.qsize()

    def submit(self, work: Work[T]) -> Future[T]:
        """Queue a request to run in the thread; cancelling the future withdraws it if it has not started.

        A request that an answer submits, in the thread, is still carried out after `close`.

        Returns:
            Its result once it is durable, or a `RecordsError`.
        """
        future: Future[T] = Future()
        # Under the lock, so that no other thread queues a request behind the entry that ends the writer.
        with self._gate:
            if self._closed and threading.current_thread() is not self._thread:
                future.set_exception(RecordsClosedError(messages.CLOSED(), messages.OPEN_FIRST()))
            else:
                self._queue.put((work, future))
        return future

    def close(self) -> None:
        """Finish the queue and end the thread. Idempotent; blocks."""
        with self._gate:
            if not self._closed:
                self._closed = True
                self._queue.put(None)
        self._thread.join()

    def _run(self, opened: Future[None]) -> None:
        try:
            self._connection = self._connect()
        except Exception as error:  # noqa: BLE001 (handed to the caller)
            opened.set_exception(map_error(error, self._place))
            return
        opened.set_result(None)
        last = False
        while not last or not self._queue.empty():
            batch = [self._queue.get()]
            while len(batch) < LARGEST_BATCH and not self._queue.empty():
                batch.append(self._queue.get())
            last = last or None in batch
            taken = [entry for entry in batch if entry is not None and entry[1].set_running_or_notify_cancel()]
            if taken:
                self._carry_out(taken)
        self._disconnect()

    def _carry_out(self, batch: list[tuple[Work[Any], Future[Any]]]) -> None:
        """Run one transaction, and then answer its requests."""
        answers: list[Any] = []
        committed = False
        try:
            if self._connection is None:
                self._connection = self._connect()
            with self._connection.begin():
                answers.extend(self._attempt(self._connection, work) for work, _ in batch)
                self._before_commit(self._connection)
        except Exception as error:  # noqa: BLE001 (raised to all callers)
            told = map_error(error, self._place)
            answers = [told] * len(batch)
            self.error = told.message
            self._disconnect()  # the next batch begins with a sound connection, if there can be one
        else:
            self.writes += 1
            self.last_write_s = time.monotonic()
            self.error = None
            committed = True
        for (_, future), answer in zip(batch, answers, strict=True):
            if isinstance(answer, RecordsError):
                self._failures[answer.code] += 1
                future.set_exception(answer)
            else:
                future.set_result(answer)
        # After the answers: the PLC does not wait for the signature of the audit trail's head.
        if committed:
            self._after_commit()

    def _attempt(self, connection: Connection, work: Work[Any]) -> Any:
        """Return the request's result, or the error for which it alone was rolled back; raise errors of the whole."""
        # By the driver: SQLAlchemy compiles each of its own savepoints anew.
        connection.exec_driver_sql("SAVEPOINT request")
        try:
            result = work(connection)
        except Exception as error:
            found = map_error(error, self._place)
            # SQLite may have undone all of it already, the savepoint too. An error that needed no mapping is no fault
            # but the request's own refusal, as of a trigger below the reserve: the others are still carried out.
            if isinstance(found, CONCERNING_ALL) and found is not error:
                raise found from error
            connection.exec_driver_sql("ROLLBACK TO request")
            connection.exec_driver_sql("RELEASE request")
            return found
        connection.exec_driver_sql("RELEASE request")
        return result

    def _disconnect(self) -> None:
        if self._connection is not None:
            with contextlib.suppress(Exception):
                self._connection.close()
        self._connection = None

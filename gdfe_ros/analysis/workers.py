# SPDX-License-Identifier: Apache-2.0
"""Tasks on the workers of a dask cluster: processes with one thread each, on this machine or on others."""

from __future__ import annotations

import asyncio
import logging
import os
import signal
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from typing import TYPE_CHECKING, Any

from gdfe_ros.errors import GdfeError

if TYPE_CHECKING:
    from distributed import Client, Future, LocalCluster, as_completed

THREAD_COUNTS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
"""Environment variables that limit the number of threads; libraries read them when they are imported."""
BATCH_SECONDS = 1.0
"""Intended duration of a batch [s]. Short tasks are combined into batches, because the scheduler needs some
milliseconds per batch. If the workers use all cores, these milliseconds reduce their computing time.
"""
_SHARE = 4
"""The remaining tasks are divided into at least this number of batches per thread, so that all threads end together."""
LONGEST_ABSENCE = 600.0
"""If there is no worker on this machine for this time [s], the tasks fail. With a user's own scheduler, they wait."""
_POLL = 0.02
_LOOK = 1.0
"""While no batch is completed, the workers are checked at this interval [s]."""
_SETTINGS = {
    # dask's profiler would stop solves every 10 ms.
    "distributed.worker.profile.enabled": False,
    # The scheduler's self-monitoring takes 3 % of a core, which the workers need.
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "5s",
    "distributed.worker.memory.monitor-interval": "1s",
    # A dead worker is started again, which may take long on a busy machine. By default, dask waits 15 s and then closes
    # the process that starts the worker, and the tasks wait for ever.
    "distributed.deploy.lost-worker-timeout": "1d",
}


@contextmanager
def connect(scheduler: str | None, workers: int) -> Iterator[Client]:
    """Yield a client of a user's own scheduler, or of ``workers`` new processes with one thread each on this machine.

    A worker that dies is restarted, and its tasks go to another worker.
    """
    import dask  # imported late: a program that runs nothing in parallel needs no dask
    from distributed import Client

    if scheduler:
        with Client(scheduler) as client:
            yield client
        return
    with dask.config.set(_SETTINGS), _one_thread(), _open_cluster(workers) as cluster, Client(cluster) as client:
        yield client


@contextmanager
def _open_cluster(workers: int) -> Iterator[LocalCluster]:
    """Yield a cluster of this machine; at an interruption its workers are killed, without reports.

    Ctrl-C interrupts all processes of a terminal. SIGINT is blocked while the cluster's thread starts, which starts the
    workers, so that it reaches this process only.
    """
    from distributed import LocalCluster

    cluster: LocalCluster | None = None
    resource_tracker.ensure_running()  # begun later, it would unblock the signal
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        cluster = LocalCluster(n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=":0")
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        yield cluster
    except KeyboardInterrupt:
        logging.getLogger("distributed").setLevel(logging.CRITICAL)
        for nanny in cluster.workers.values() if cluster is not None else ():
            nanny.auto_restart = False
            with suppress(ProcessLookupError, TypeError):  # it has ended, or is not started
                os.kill(nanny.pid, signal.SIGKILL)
        raise
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        # On a busy machine dask may take longer than 5 s to notice that a worker that it killed has ended. If it was
        # about to start a dead worker again, which has no process yet, it raises AssertionError.
        with suppress(TimeoutError, asyncio.TimeoutError, AssertionError):
            if cluster is not None:
                cluster.close()


@contextmanager
def _one_thread() -> Iterator[None]:
    """Set `THREAD_COUNTS` to one, for processes that start meanwhile; dask does not override the environment."""
    before = {name: os.environ.get(name) for name in THREAD_COUNTS}
    os.environ.update(dict.fromkeys(THREAD_COUNTS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name) if value is None else os.environ.__setitem__(name, value)


def run_tasks(
    client: Client, function: Callable[[Any], Any], tasks: Sequence[Any]
) -> Iterator[tuple[int, Any, Exception | None]]:
    """Yield the number of each task, ``function(task)`` and None, in the order in which tasks are completed.

    For a task that failed, the result is None, and the third item is the exception: the function's, or dask's
    `KilledWorker` if the task was tried four times and its worker died each time.

    Args:
        client: client of `connect`.
        function: function that workers can unpickle; it is called in their processes.
        tasks: its arguments.

    Raises:
        GdfeError: all workers on this machine died and do not restart.
    """
    from distributed import as_completed

    queue = _Queue(client, function, tasks)
    finished = as_completed(queue.refill())
    for future in _wait(client, finished):
        done = list(queue.collect(future))
        for batch in queue.refill():  # before the results are used, so that workers do not wait for the disk
            finished.add(batch)
        yield from done


def map_tasks(client: Client | None, function: Callable[[Any], Any], tasks: Sequence[Any]) -> list[Any]:
    """Return ``function(task)`` for each task, in the order of the tasks; without a client, all run in this process.

    Raises:
        GdfeError: a task was tried four times, and its worker died each time; or there are no workers any more.
        Exception: the exception of the first task that failed.
    """
    if client is None:
        return [function(task) for task in tasks]
    from distributed import KilledWorker

    results = [None] * len(tasks)
    for number, result, error in run_tasks(client, function, tasks):
        if isinstance(error, KilledWorker):
            raise GdfeError(f"the workers of a task died: {error}; remedy: fewer --workers, they share the memory")
        if error is not None:
            raise error
        results[number] = result
    return results


def _wait(client: Client, finished: as_completed) -> Iterator[Future]:
    """Yield batches when they are completed; raise a GdfeError if there is no worker for `LONGEST_ABSENCE`."""
    looked = seen = time.monotonic()
    while not finished.is_empty():
        if finished.has_ready():
            yield next(finished)
            seen = time.monotonic()
            continue
        time.sleep(_POLL)
        if (now := time.monotonic()) < looked + _LOOK:
            continue
        looked = now
        if client.cluster is None or client.nthreads():
            seen = now
        elif now > seen + LONGEST_ABSENCE:
            raise GdfeError(
                f"there has been no worker for {LONGEST_ABSENCE:g} s; repeat the same command (a sweep continues with "
                "the cases that are left)"
            )


class _Queue:
    """Tasks that are not yet in a batch, and the running batches.

    If the worker of a batch dies, or a task of it fails, each of its tasks is repeated in a batch of its own. A task
    that makes workers die then affects no other task.
    """

    def __init__(self, client: Client, function: Callable[[Any], Any], tasks: Sequence[Any]) -> None:
        # Every batch contains all that its tasks need. Data scattered to the workers would be lost if all workers die,
        # and the tasks would wait for ever.
        self._client, self._function, self._tasks = client, function, tasks
        self._left, self._alone = deque(range(len(tasks))), deque[int]()
        self._running: dict[Future, list[int]] = {}
        self._seconds: float | None = None

    def refill(self) -> list[Future]:
        """Start a batch for each idle thread, and return the batches.

        No batch waits at a worker: if a worker dies, dask counts a failure of every batch that is assigned to it.
        """
        threads = max(1, sum(self._client.nthreads().values()))
        started = []
        while (self._alone or self._left) and len(self._running) < threads:
            numbers = self._next(threads)
            tasks = [self._tasks[number] for number in numbers]
            started.append(self._client.submit(_run_batch, self._function, tasks, pure=False))
            self._running[started[-1]] = numbers
        return started

    def collect(self, future: Future) -> Iterator[tuple[int, Any, Exception | None]]:
        """Yield the tasks of a completed batch as `run_tasks` does; if the batch failed, repeat them one by one."""
        numbers = self._running.pop(future)
        try:
            results, seconds = future.result()
        except CancelledError:  # the results were lost with the worker that held them
            self._alone.extend(numbers)
        except Exception as failure:  # the task's exception, or the one about the death of its workers
            if len(numbers) > 1:
                self._alone.extend(numbers)
            else:
                yield numbers[0], None, failure
        else:
            self._seconds = seconds / len(numbers)
            for number, result in zip(numbers, results, strict=True):
                yield number, result, None
        future.release()

    def _next(self, threads: int) -> list[int]:
        """Return the tasks of the next batch; their number is chosen so that the batch lasts `BATCH_SECONDS`."""
        if self._alone:
            return [self._alone.popleft()]
        count = 1
        if self._seconds is not None:
            fair = len(self._left) // (_SHARE * threads)
            count = max(1, min(fair, round(BATCH_SECONDS / max(self._seconds, 1e-6))))
        return [self._left.popleft() for _ in range(count)]


def _run_batch(function: Callable[[Any], Any], tasks: Sequence[Any]) -> tuple[list[Any], float]:
    """Return the results of tasks that run one after the other, and their duration [s]."""
    started = time.perf_counter()
    return [function(task) for task in tasks], time.perf_counter() - started

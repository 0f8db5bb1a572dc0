# SPDX-License-Identifier: Apache-2.0
"""Distribution of cases to the workers of a dask cluster."""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress

import dask
from distributed import Client, Future, LocalCluster, as_completed

from gdfe_ros.analysis.sweep.case_run import Result, run_cases_in_turn
from gdfe_ros.analysis.sweep.cases import Case
from gdfe_ros.errors import GdfeError
from gdfe_ros.workers import THREAD_COUNTS

TASK_SECONDS = 1.0
"""Intended duration of a task [s]. Short cases are combined into tasks, because the scheduler needs some milliseconds
per task. If the workers use all cores, these milliseconds reduce their computing time.
"""
_SHARE = 4
"""Least number of tasks per thread into which the remaining cases are divided, so that all threads end together."""
PATIENCE = 600.0
"""Time [s] without any worker after which a sweep on this machine fails. With a user's own scheduler it never fails."""
_POLL = 0.02
_LOOK = 1.0
"""While no task is completed, the workers are checked at this interval [s]."""
_SETTINGS = {
    # Solves run in one thread each; dask's profiler would stop them every 10 ms.
    "distributed.nanny.pre-spawn-environ": dict.fromkeys(THREAD_COUNTS, 1),
    "distributed.worker.profile.enabled": False,
    # The scheduler's self-monitoring takes 3 % of a core, which the workers need.
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "5s",
    "distributed.worker.memory.monitor-interval": "1s",
    # A dead worker is started again, which may take long on a busy machine. By default, dask waits 15 s and then closes
    # the process that starts the worker, and the sweep waits for ever.
    "distributed.deploy.lost-worker-timeout": "1d",
}


@contextmanager
def connect(scheduler: str | None, workers: int) -> Iterator[Client]:
    """Yield a client of a user's own scheduler, or of ``workers`` new processes with one thread each on this machine.

    A worker that dies is restarted, and its cases go to another worker.
    """
    if scheduler:
        with Client(scheduler) as client:
            yield client
        return
    with dask.config.set(_SETTINGS):
        cluster = LocalCluster(n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=":0")
        try:
            with Client(cluster) as client:
                yield client
        finally:
            # On a busy machine dask may take longer than 5 s to notice that a worker that it killed has ended.
            with suppress(TimeoutError, asyncio.TimeoutError):
                cluster.close()


def run_cases(client: Client, scene: str, cases: Sequence[Case]) -> Iterator[tuple[Case, Result]]:
    """Run cases and yield each case with its result when it is completed.

    If a case fails in a worker, its result is this failure. A case also fails if it was tried four times and its
    worker died each time.

    Raises:
        GdfeError: all workers on this machine died and do not restart.
    """
    queue = _Queue(client, scene, cases)
    finished = as_completed(queue.refill())
    for future in _as_done(client, finished):
        done = list(queue.take(future))
        for task in queue.refill():  # before the results are written, so that workers do not wait for the disk
            finished.add(task)
        yield from done


def _as_done(client: Client, finished: as_completed) -> Iterator[Future]:
    """Yield tasks when they are completed; raise a GdfeError if there is no worker for `PATIENCE`."""
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
        elif now > seen + PATIENCE:
            raise GdfeError(
                f"there has been no worker for {PATIENCE:g} s; repeat the same command to continue with "
                "the cases that are left"
            )


class _Queue:
    """Cases that are not yet in a task, and the running tasks.

    If the worker of a task dies, each case of the task is repeated in a task of its own. A case that makes workers die
    then affects no other case.
    """

    def __init__(self, client: Client, scene: str, cases: Sequence[Case]) -> None:
        # Every task contains the scene. Data scattered to the workers would be lost if all workers die, and the sweep
        # would wait for ever.
        self._client, self._scene = client, scene
        self._left, self._alone = deque(cases), deque[Case]()
        self._running: dict[Future, tuple[Case, ...]] = {}
        self._seconds: float | None = None
        self._count = 0

    def refill(self) -> list[Future]:
        """Start a task for each idle thread, and return the tasks.

        No task waits at a worker: if a worker dies, dask counts a failure of every task that is assigned to it.
        """
        threads = max(1, sum(self._client.nthreads().values()))
        started = []
        while (self._alone or self._left) and len(self._running) < threads:
            started.append(self._submit(self._next(threads)))
        return started

    def take(self, future: Future) -> Iterator[tuple[Case, Result]]:
        """Yield the cases of a completed task with their results; if its worker died, repeat its cases one by one."""
        cases, results, error = self._running.pop(future), [], None
        try:
            results = future.result()
        except CancelledError:  # the results were lost with the worker that held them
            self._alone.extend(cases)
        except Exception as failure:  # the task's exception, or the one about the death of its workers
            error = failure
        if results:
            self._seconds = sum(result["elapsed"] for result in results) / len(results)
            yield from zip(cases, results, strict=True)
        elif error is not None and len(cases) > 1:
            self._alone.extend(cases)
        elif error is not None:
            yield cases[0], {"status": "failed", "error": f"{type(error).__name__}: {error}"}
        future.release()

    def _next(self, threads: int) -> list[Case]:
        """Return the cases of the next task; their number is chosen so that the task lasts `TASK_SECONDS`."""
        if self._alone:
            return [self._alone.popleft()]
        count = 1
        if self._seconds is not None:
            fair = len(self._left) // (_SHARE * threads)
            count = max(1, min(fair, round(TASK_SECONDS / max(self._seconds, 1e-6))))
        return [self._left.popleft() for _ in range(count)]

    def _submit(self, cases: list[Case]) -> Future:
        overrides = [dict(case.overrides) for case in cases]
        self._count += 1  # the scheduler may not have removed an earlier use of the key yet
        key = f"gdfe-{cases[0].name}-{self._count}-{len(cases)}"
        future = self._client.submit(run_cases_in_turn, self._scene, overrides, key=key, pure=False)
        self._running[future] = tuple(cases)
        return future

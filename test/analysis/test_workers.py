# SPDX-License-Identifier: Apache-2.0
"""Tasks on workers: threads, killed workers, failures, and clusters without workers."""

from __future__ import annotations

import math
import operator
import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

import distributed
import psutil
import pytest

from gdfe_ros.analysis import workers
from gdfe_ros.analysis.workers import THREAD_COUNTS, connect, map_tasks, run_tasks
from gdfe_ros.entry import INTERRUPTED
from gdfe_ros.errors import GdfeError

NOBODY = 2**31 - 1
"""A process id that no process has."""


def test_workers_have_one_thread_and_this_process_keeps_its_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two fresh workers have one thread in their environment, and this process's environment is unchanged."""
    monkeypatch.setenv("NUMBA_NUM_THREADS", "7")
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    with connect(None, 2) as client:
        assert map_tasks(client, os.getenv, THREAD_COUNTS) == ["1"] * len(THREAD_COUNTS)
    assert os.environ["NUMBA_NUM_THREADS"] == "7"
    assert "OMP_NUM_THREADS" not in os.environ


def test_results_are_in_the_order_of_the_tasks() -> None:
    """Without a client, and on the workers of a user's own scheduler, each task has its result."""
    with connect(None, 2) as own, connect(own.scheduler.address, 2) as client:
        for each in (None, client):
            assert map_tasks(each, math.sqrt, range(50)) == [math.sqrt(k) for k in range(50)]


def test_a_failed_task_fails_alone() -> None:
    """Of several tasks the one that raises an exception yields it, and `map_tasks` raises it."""
    with connect(None, 1) as client:
        found = sorted(run_tasks(client, math.sqrt, [4.0, -1.0, 9.0, 16.0]), key=operator.itemgetter(0))
        assert [result for _, result, _ in found] == [2.0, None, 3.0, 4.0]
        assert [type(error) for *_, error in found] == [type(None), ValueError, type(None), type(None)]
        with pytest.raises(ValueError, match=r"math domain error|nonnegative"):
            map_tasks(client, math.sqrt, [4.0, -1.0])


def test_a_task_that_kills_its_workers_is_named() -> None:
    """A task whose worker dies four times ends with an error that names a remedy."""
    with connect(None, 2) as client, pytest.raises(GdfeError, match=r"workers of a task died.*fewer --workers"):
        map_tasks(client, os._exit, [1])


@pytest.mark.parametrize("error", [TimeoutError(), AssertionError("can only join a started process")], ids=type)
def test_results_survive_workers_that_end_late(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    """Results are returned even if dask cannot wait for the end of a worker, as of one that it was about to start."""
    close = distributed.LocalCluster.close

    def late(cluster: object, timeout: float | None = None) -> None:
        close(cluster, timeout)
        raise error

    monkeypatch.setattr(distributed.LocalCluster, "close", late)
    with connect(None, 1) as client:
        results = map_tasks(client, math.sqrt, [1.0, 4.0])
    assert results == [1.0, 2.0]


def test_tasks_without_workers_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tasks without any worker end with an error after a limited wait."""
    monkeypatch.setattr(workers, "LONGEST_ABSENCE", 2.0)
    with connect(None, 0) as client, pytest.raises(GdfeError, match="there has been no worker for 2 s"):
        map_tasks(client, math.sqrt, [1.0, 4.0])


@pytest.mark.slow
def test_workers_that_take_long_to_come_back_are_waited_for() -> None:
    """After all workers were killed for 20 s, longer than dask waits for a lost one, every task is run."""
    over = threading.Event()

    def kill() -> None:
        while not over.wait(0.05):
            for nanny in list(client.cluster.workers.values()):
                with suppress(ProcessLookupError):
                    os.kill(nanny.pid or NOBODY, signal.SIGKILL)

    with connect(None, 2) as client:
        thread = threading.Thread(target=kill)
        thread.start()
        threading.Timer(20.0, over.set).start()
        done = map_tasks(client, time.sleep, [0.5] * 20)
        thread.join()
    assert done == [None] * 20


@pytest.mark.parametrize("busy", [0.0, 3.0], ids=["starting", "solving"])
def test_an_interruption_ends_all_processes_without_reports(tmp_path: Path, busy: float) -> None:
    """Ctrl-C, which reaches all processes of a terminal, ends a command and its workers soon, with one line."""
    command = [
        sys.executable,
        "-m",
        "gdfe_ros.cli",
        "workspace",
        "tendon_finger",
        "--count",
        "100000",
        "--workers",
        "2",
    ]
    process = subprocess.Popen(
        command, cwd=tmp_path, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True, start_new_session=True
    )
    whole, children = psutil.Process(process.pid), []
    while len(children) < 3 or min(sum(each.cpu_times()[:2]) for each in children[1:]) < busy:  # without the tracker
        assert process.poll() is None
        time.sleep(0.05)
        children = whole.children()
    os.killpg(process.pid, signal.SIGINT)
    assert process.communicate(timeout=60.0)[1] == "gdfe workspace: interrupted\n"
    assert process.returncode == INTERRUPTED
    assert not any(each.is_running() and each.status() != psutil.STATUS_ZOMBIE for each in children[1:])

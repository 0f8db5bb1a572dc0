# SPDX-License-Identifier: Apache-2.0
"""Nodes forked from a server process that has already imported the package and loaded the kernels.

A new ``sim_node`` takes seconds to start. After a call of ``prepare``, each later ``NodeProcess`` starts in a fraction
of this time. It is still a separate process, with its own log, signals and exit status. This module is meant for the
conftest.py of tests that start many nodes.
"""

from __future__ import annotations

import faulthandler
import multiprocessing
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from multiprocessing.context import ForkServerContext
from pathlib import Path

_PRELOAD = "gdfe_ros.testing.preloaded"
_SERVER: list[ForkServerContext] = []


def prepare() -> None:
    """Fork all nodes that this process starts from now on. Set environment variables of numba before this call."""
    _SERVER[:] = [preload()]


def preload() -> ForkServerContext:
    """Return the multiprocessing context of a server that imports the package before it forks processes.

    The server starts with the first process. If it is running already, it imports nothing more.
    """
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([_PRELOAD])
    return context


def start(
    arguments: Sequence[str], log: Path, environment: Mapping[str, str], *, home: Path | None = None
) -> subprocess.Popen[bytes] | Forked:
    """Start ``sim_node`` with command-line arguments, and return its process.

    Args:
        arguments: arguments of the command line.
        log: file of its output.
        environment: environment of the process.
        home: directory that contains another package to run. The process then starts there, because Python's ``-m``
            searches the working directory first, and it is not forked from a process that has this package.
    """
    if _SERVER and home is None:
        return Forked(_SERVER[0], arguments, log, environment)
    with log.open("wb") as file:
        command = [sys.executable, "-X", "faulthandler", "-m", "gdfe_ros.node", *arguments]
        return subprocess.Popen(command, stdout=file, stderr=file, env=dict(environment), cwd=home)


class Forked:
    """Process forked from the server; it has the methods of ``subprocess.Popen`` that ``NodeProcess`` uses.

    Attributes:
        pid: process id.
    """

    def __init__(
        self, server: ForkServerContext, arguments: Sequence[str], log: Path, environment: Mapping[str, str]
    ) -> None:
        log.touch()
        given = (tuple(arguments), str(log), dict(environment))
        self._process = server.Process(target=_run, args=given, name="sim_node", daemon=True)
        self._process.start()
        self.pid = self._process.pid

    def poll(self) -> int | None:
        """Return the exit status, which is -n after signal n; None while the process runs."""
        return self._process.exitcode

    def wait(self, timeout: float | None = None) -> int:
        """Wait at most ``timeout`` [s] for the process to end and return the exit status.

        Raises:
            subprocess.TimeoutExpired: the process still runs.
        """
        self._process.join(timeout)
        if (status := self.poll()) is None:
            raise subprocess.TimeoutExpired("sim_node", timeout or 0.0)
        return status

    def send_signal(self, number: int) -> None:
        """Send a signal to the process, unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """Kill the process."""
        self._process.kill()


def _run(arguments: tuple[str, ...], log: str, environment: dict[str, str]) -> None:
    """Run ``sim_node`` in the forked process."""
    from gdfe_ros.entry import sim_node

    file = os.open(log, os.O_WRONLY)
    for descriptor in (1, 2):
        os.dup2(file, descriptor)
    os.close(file)
    faulthandler.enable()  # after a crash the log has the stack of each thread
    os.environ.clear()
    os.environ.update(environment)
    sys.argv[:] = ["sim_node", *arguments]
    sys.exit(sim_node())

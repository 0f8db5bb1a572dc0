# SPDX-License-Identifier: Apache-2.0
"""Work of a benchmark in a process of its own, with a fixed number of threads."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from typing import Any

from benchmarks.provenance import ROOT
from gdfe_ros.analysis.workers import THREAD_COUNTS
from gdfe_ros.errors import GdfeError

_THREADS = (*THREAD_COUNTS, "CCX_NPROC_EQUATION_SOLVER", "CCX_NPROC_RESULTS", "CCX_NPROC_STIFFNESS")


class PeerError(GdfeError):
    """A peer that is not installed, or a process that failed or took too long."""


def run_module(module: str, request: Any, where: str, *, timeout: float, threads: int = 1) -> Any:
    """Run ``python -m MODULE REQUEST`` and return what its last line says; request and answer are JSON.

    Args:
        module: name of the module.
        request: its argument.
        where: words about the work for errors.
        timeout: longest wall time [s].
        threads: number of threads that libraries in the process may use.

    Raises:
        PeerError: the process fails, with the end of its output, or takes too long.
    """
    command = [sys.executable, "-m", module, json.dumps(request)]
    options = {"env": worker_environment(threads), "capture_output": True, "text": True, "check": False}
    with tempfile.TemporaryDirectory(prefix="gdfe_bench_") as folder:  # some libraries write files where they run
        try:
            done = subprocess.run(command, cwd=folder, timeout=timeout, **options)
        except subprocess.TimeoutExpired:
            raise PeerError(f"{where}: no result within {timeout:g} s; raise the timeout") from None
    if done.returncode != 0 or not done.stdout.strip():
        tail = "\n".join((done.stderr or done.stdout).strip().splitlines()[-6:])
        raise PeerError(f"{where}: the process ended with status {done.returncode}:\n{tail}")
    return json.loads(done.stdout.strip().splitlines()[-1])


def worker_environment(threads: int) -> dict[str, str]:
    """Return the environment variables of a process, which limit its threads and make this package importable."""
    path = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH", "")]))
    return {**os.environ, **dict.fromkeys(_THREADS, str(threads)), "PYTHONPATH": path, "FELUPE_VERBOSE": "false"}

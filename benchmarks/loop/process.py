# SPDX-License-Identifier: Apache-2.0
"""A process that carries out tasks with the package of one tree, and the tree of another commit."""

from __future__ import annotations

import io
import json
import os
import select
import subprocess
import sys
import tarfile
from pathlib import Path
from typing import Any

from benchmarks.loop.row import Task
from benchmarks.provenance import ROOT
from gdfe_ros.analysis.workers import THREAD_COUNTS

TREES = ROOT / "build" / "loop"
"""Folder of other commits' trees, and of their known errors."""
PATIENCE = 900.0
"""Longest time [s] for one answer; at its first task, a process compiles."""
START = (
    "import sys; sys.path.insert(0, {tree!r}); import gdfe_ros; "
    "assert gdfe_ros.__file__.startswith({tree!r}), gdfe_ros.__file__; "
    "sys.path.insert(0, {root!r}); from benchmarks.loop.worker import main; main()"
)
"""Program of the process: the package of the tree, but this tree's benchmarks."""


def unpack_tree(commit: str) -> Path:
    """Return the folder with a commit's files, which are unpacked if they are not there; a path is returned as it is.

    Raises:
        subprocess.CalledProcessError: no such commit.
    """
    if Path(commit, "gdfe_ros").is_dir():
        return Path(commit).resolve()
    command = ["git", "rev-parse", "--short=8", f"{commit}^{{commit}}"]
    short = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()
    tree = TREES / short
    if not tree.is_dir():
        packed = subprocess.run(["git", "archive", short], cwd=ROOT, check=True, capture_output=True).stdout
        beside = tree.with_name(f".{short}.{os.getpid()}")
        with tarfile.open(fileobj=io.BytesIO(packed)) as files:
            files.extractall(beside, filter="data")
        beside.rename(tree)
    return tree


class Worker:
    """A process with one thread on one core; it starts with its first task.

    Args:
        tree: folder that contains the package.
        core: core of the process.
    """

    def __init__(self, tree: Path, core: int) -> None:
        self._tree, self._core = tree, core
        self._process: subprocess.Popen[str] | None = None

    def ask(self, work: str, task: Task, **options: Any) -> dict[str, Any]:
        """Return the answer to a request (see `benchmarks.loop.worker`), or ``failed`` with a reason.

        A process that ends, or does not answer within `PATIENCE`, is replaced at the next request.
        """
        process = self._process = self._process or self._start()
        try:
            process.stdin.write(json.dumps({"work": work, "task": task.request, **options}) + "\n")
            process.stdin.flush()
            ready = select.select([process.stdout], [], [], PATIENCE)[0]
            line = process.stdout.readline() if ready else ""
        except BrokenPipeError:
            line = ""
        if line:
            return json.loads(line)
        process.kill()
        process.communicate()
        self._process = None
        return {"failed": f"no answer within {PATIENCE:g} s, or the process ended: status {process.returncode}"}

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.communicate()
            self._process = None

    def _start(self) -> subprocess.Popen[str]:
        TREES.mkdir(parents=True, exist_ok=True)
        program = START.format(tree=str(self._tree), root=str(ROOT))
        own = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        process = subprocess.Popen(
            [sys.executable, "-c", program],
            cwd=TREES,
            env=own | dict.fromkeys(THREAD_COUNTS, "1"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        os.sched_setaffinity(process.pid, {self._core})
        return process

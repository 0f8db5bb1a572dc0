# SPDX-License-Identifier: Apache-2.0
"""``sim_node`` in a process of its own."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import gdfe_ros
from gdfe_ros.testing.forking import start

_PATIENCE = 180.0
"""Longest time until a process ends after a signal [s]."""


class NodeProcess:
    """Process of a ``sim_node``; as a context manager, it ends the process at exit.

    Args:
        parameters: parameters of the node, by name.
        namespace: namespace of the node.
        remaps: dict from a topic's name to its new name, e.g. ``{"/clock": "clock"}``.
        home: directory that contains the package to run, e.g. of another commit; None: this package.

    Attributes:
        status: exit status, -n after signal n; None until `wait`, `stop` or `kill` has returned.
    """

    def __init__(
        self,
        parameters: Mapping[str, Any] | None = None,
        *,
        namespace: str = "/",
        remaps: Mapping[str, str] | None = None,
        home: Path | None = None,
    ) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="gdfe_node_")
        folder = Path(self._folder.name)
        values = {"/**": {"ros__parameters": dict(parameters or {})}}
        # JSON is YAML; a file avoids the quoting that -p needs.
        (folder / "parameters.yaml").write_text(json.dumps(values), encoding="utf-8")
        self._log = folder / "log.txt"
        arguments = ["--ros-args", "--params-file", str(folder / "parameters.yaml"), "-r", f"__ns:={namespace}"]
        for before, after in (remaps or {}).items():
            arguments += ["-r", f"{before}:={after}"]
        self._process = start(arguments, self._log, package_environment(home), home=home)
        self.status: int | None = None

    @property
    def log(self) -> str:
        """Standard output and error of the process so far."""
        return self._log.read_text(encoding="utf-8", errors="replace")

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    @property
    def running(self) -> bool:
        """Whether the process still runs."""
        return self._process.poll() is None

    def wait(self) -> int:
        """Wait for the process to end by itself and return its exit status."""
        self.status = self._process.wait(_PATIENCE)
        return self.status

    def stop(self, number: signal.Signals = signal.SIGINT) -> int:
        """End the process with a signal, or kill it if it does not end; return its exit status, -n after signal n.

        If this process ignores SIGINT, as a shell's background job does, so does the node, and SIGTERM ends it.
        """
        if number is signal.SIGINT and signal.getsignal(number) is signal.SIG_IGN:
            number = signal.SIGTERM
        if self.status is None:
            self._process.send_signal(number)
            try:
                self.status = self._process.wait(_PATIENCE)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self.status = self._process.wait()
        return self.status

    def kill(self) -> None:
        """Kill the process by SIGKILL, so that it cannot complete its files."""
        self._process.kill()
        self.status = self._process.wait()

    def __enter__(self) -> NodeProcess:
        return self

    def __exit__(self, kind: type[BaseException] | None, *error: object) -> None:
        self.stop()
        if kind is not None:
            print(f"--- log of sim_node (exit status {self.status}) ---\n{self.log}", file=sys.stderr)
        self._folder.cleanup()


def package_environment(home: Path | None = None) -> dict[str, str]:
    """Return this process's environment with ``home`` first in ``PYTHONPATH``; None: the directory of this package."""
    home = home or Path(gdfe_ros.__file__).resolve().parents[1]
    path = os.pathsep.join(filter(None, [str(home), os.environ.get("PYTHONPATH", "")]))
    return {**os.environ, "PYTHONPATH": path}

# SPDX-License-Identifier: Apache-2.0
"""Nodes of a process that runs in a shell's background."""

from __future__ import annotations

import subprocess
import sys

_CODE = """
import signal, time
signal.signal(signal.SIGINT, signal.SIG_IGN)
from gdfe_ros.testing import NodeProcess
with NodeProcess({"scene": "bend5", "clock": "lockstep"}) as node:
    while "active" not in node.log and node.running:
        time.sleep(0.05)
    print("status", node.stop())
"""


def test_a_background_job_stops_its_node() -> None:
    """A node whose parent ignores SIGINT, as background jobs do, ends when it is stopped, with status 0."""
    done = subprocess.run([sys.executable, "-c", _CODE], capture_output=True, text=True, check=True)
    assert done.stdout == "status 0\n", done.stderr

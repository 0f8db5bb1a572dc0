# SPDX-License-Identifier: Apache-2.0
"""Names of this package's threads for ``top -H``, ``perf`` and debuggers."""

from __future__ import annotations

import threading
from pathlib import Path

STEPPER, COURIER, RECORDER = "gdfe-stepper", "gdfe-courier", "gdfe-recorder"
"""Threads of a node beside those of rclpy: one solves, one publishes, one writes the bag."""
VIEWER = "gdfe-viewer"
"""Thread of a live page that draws, beside the threads of the stepper and the server."""


def show_name() -> None:
    """Give the calling thread its Python name in the operating system, too; Linux only, at most 15 letters."""
    entry = Path(f"/proc/self/task/{threading.get_native_id()}/comm")
    if entry.exists():
        entry.write_text(threading.current_thread().name[:15], encoding="utf-8")

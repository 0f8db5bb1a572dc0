# SPDX-License-Identifier: Apache-2.0
"""Names of this package's threads for ``top -H``, ``perf`` and debuggers."""

from __future__ import annotations

import threading
from pathlib import Path

STEPPER, PUBLISHER, RECORDER = "gdfe-stepper", "gdfe-publisher", "gdfe-recorder"
"""Names of the threads that a node has besides those of rclpy: one solves, one publishes, one writes the bag."""
VIEWER = "gdfe-viewer"
"""Name of the thread of a live page that draws; stepper and server have their own threads."""


def show_name() -> None:
    """Set the Python name of the calling thread also in the operating system; Linux only, at most 15 letters."""
    entry = Path(f"/proc/self/task/{threading.get_native_id()}/comm")
    if entry.exists():
        entry.write_text(threading.current_thread().name[:15], encoding="utf-8")

# SPDX-License-Identifier: Apache-2.0
"""Names of threads, and worker processes with one thread each."""

from __future__ import annotations

import multiprocessing
import os
import threading
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path

THREAD_COUNTS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
"""Environment variables that limit the number of threads; libraries read them when they are imported."""


@contextmanager
def open_workers(count: int) -> Iterator[ProcessPoolExecutor]:
    """Yield an executor of ``count`` new processes with one thread each.

    The processes start with their first tasks. Therefore `THREAD_COUNTS` are set in this process while the executor is
    open.
    """
    before = {name: os.environ.get(name) for name in THREAD_COUNTS}
    os.environ.update(dict.fromkeys(THREAD_COUNTS, "1"))
    try:
        with ProcessPoolExecutor(count, mp_context=multiprocessing.get_context("spawn")) as executor:
            yield executor
    finally:
        for name, value in before.items():
            os.environ.pop(name) if value is None else os.environ.__setitem__(name, value)


STEPPER, COURIER, RECORDER = "gdfe-stepper", "gdfe-courier", "gdfe-recorder"
"""Names of the threads that a node has besides those of rclpy: one solves, one publishes, one writes the bag."""
VIEWER = "gdfe-viewer"
"""Name of the thread of a live page that draws; stepper and server have their own threads."""


def show_name() -> None:
    """Set the Python name of the calling thread also in the operating system; Linux only, at most 15 letters."""
    entry = Path(f"/proc/self/task/{threading.get_native_id()}/comm")
    if entry.exists():
        entry.write_text(threading.current_thread().name[:15], encoding="utf-8")

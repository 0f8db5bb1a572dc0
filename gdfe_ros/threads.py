# SPDX-License-Identifier: Apache-2.0
"""Names of threads, as ``top -H``, ``perf`` and debuggers show them, and BLAS with one thread for small matrices."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

try:
    from threadpoolctl import ThreadpoolController
except ImportError:  # an optional dependency: without it OPENBLAS_NUM_THREADS and the like decide
    ThreadpoolController = None

STEPPER, PUBLISHER, RECORDER = "gdfe-stepper", "gdfe-publisher", "gdfe-recorder"
"""Names of the threads that a node has besides those of rclpy: one solves, one publishes, one writes the bag."""
VIEWER = "gdfe-viewer"
"""Name of the thread of a live page that draws; stepper and server have their own threads."""


def show_name() -> None:
    """Set the Python name of the calling thread also in the operating system; Linux only, at most 15 letters."""
    entry = Path(f"/proc/self/task/{threading.get_native_id()}/comm")
    if entry.exists():
        entry.write_text(threading.current_thread().name[:15], encoding="utf-8")


_lock = threading.Lock()
_limiters: list[object] = []
"""One limiter for each open context of any thread. The first limiter has the original number of threads."""


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Limit BLAS to one thread inside the ``with`` block.

    The limit applies to the whole process. If contexts overlap in different threads, the last one restores the original
    number of threads.
    """
    if ThreadpoolController is None:
        yield
        return
    with _lock:
        _limiters.append(_libraries().limit(limits=1))
    try:
        yield
    finally:
        with _lock:
            limiter = _limiters.pop()
            if not _limiters:
                limiter.restore_original_limits()


@cache
def _libraries() -> ThreadpoolController:
    return ThreadpoolController().select(user_api="blas")

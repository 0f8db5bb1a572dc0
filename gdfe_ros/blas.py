# SPDX-License-Identifier: Apache-2.0
"""Limits BLAS to one thread for small matrices.

For small frontal matrices, the threads of BLAS wait for each other longer than they compute, in particular while
another process is busy.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

try:
    from threadpoolctl import ThreadpoolController
except ImportError:  # an optional dependency: without it OPENBLAS_NUM_THREADS and the like decide
    ThreadpoolController = None


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

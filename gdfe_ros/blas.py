# SPDX-License-Identifier: Apache-2.0
"""Limits BLAS to one thread for small matrices.

On small frontal matrices the threads of BLAS wait for each other longer than they work, in particular beside another
busy process.
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
"""One for each open context of any thread; the first one knows the former number."""


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Limit BLAS to one thread in this context.

    The limit holds for the whole process. The last of several contexts that overlap in different threads restores the
    former number.
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

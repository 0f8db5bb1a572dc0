# SPDX-License-Identifier: Apache-2.0
"""Limits BLAS to one thread for small matrices.

On small frontal matrices the threads of BLAS wait for each other longer than they work, in particular beside another
busy process.
"""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from functools import cache

try:
    from threadpoolctl import ThreadpoolController
except ImportError:  # an optional dependency: without it OPENBLAS_NUM_THREADS and the like decide
    ThreadpoolController = None


def one_blas_thread() -> AbstractContextManager[object]:
    """Return a context that limits BLAS to one thread, and restores the former number at its end."""
    return nullcontext() if ThreadpoolController is None else _libraries().limit(limits=1)


@cache
def _libraries() -> ThreadpoolController:
    return ThreadpoolController().select(user_api="blas")

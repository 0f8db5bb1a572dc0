# SPDX-License-Identifier: Apache-2.0
"""One thread for BLAS while a body is solved.

On small bands its threads wait for each other longer than they work, beside another busy process most of all.
"""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from functools import cache

try:
    from threadpoolctl import ThreadpoolController
except ImportError:  # an extra: without it OPENBLAS_NUM_THREADS and the like decide
    ThreadpoolController = None


def one_blas_thread() -> AbstractContextManager[object]:
    """Return what limits BLAS to one thread while it is entered, and gives it back as many as it had."""
    return nullcontext() if ThreadpoolController is None else _libraries().limit(limits=1)


@cache
def _libraries() -> ThreadpoolController:
    return ThreadpoolController().select(user_api="blas")

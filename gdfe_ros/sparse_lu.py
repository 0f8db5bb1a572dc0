# SPDX-License-Identifier: Apache-2.0
"""scipy's LU factors, made and freed in one thread.

scipy frees the memory of a factor only in the thread that made the factor. A node builds simulations in one thread and
drops them in another, so that their factors would never be freed.
"""

from __future__ import annotations

import os
import weakref
from collections import deque
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu

_KEEPER: list[ThreadPoolExecutor] = []
"""The thread that makes and frees the factors; it starts with the first factor of a process."""
_DROPPED: deque[list[SuperLU]] = deque()
"""Factors that nobody uses any more; they are freed before the next one is made."""


class LuFactor:
    """LU factor of a square matrix, as of ``scipy.sparse.linalg.splu``; any thread may use and drop it.

    Args:
        matrix: (f, f) the matrix.
        options: options of ``splu``.

    Raises:
        RuntimeError: the matrix is singular.
    """

    def __init__(self, matrix: sparse.csc_matrix, **options: Any) -> None:
        if not _KEEPER:
            _KEEPER.append(ThreadPoolExecutor(1, thread_name_prefix="gdfe-factors"))
        self._held = _KEEPER[0].submit(partial(_make, matrix, options)).result()
        weakref.finalize(self, _DROPPED.append, self._held).atexit = False

    def solve(self, right: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the solution for right-hand sides (f,) or (f, k)."""
        return self._held[0].solve(right)


def _make(matrix: sparse.csc_matrix, options: dict[str, Any]) -> list[SuperLU]:
    """Free the dropped factors, and return a list with a new one; called in the keeper's thread."""
    while _DROPPED:
        _DROPPED.popleft().clear()
    return [splu(matrix, **options)]


os.register_at_fork(after_in_child=_KEEPER.clear)  # threads do not survive a fork

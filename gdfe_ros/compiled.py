# SPDX-License-Identifier: Apache-2.0
"""Compilation of the kernels: cached on disk, without the GIL, IEEE division instead of exceptions.

Numba recompiles a kernel when its own file changes, not when a constant or kernel that it imports does. After editing
one of these, delete the ``__pycache__`` folders (``make clean``).
"""

from __future__ import annotations

from typing import Any

import numba
from numba import njit

_COMMON: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
# Set explicitly: unset flags are inherited from the first caller, so that results would depend on which one it is.
_EXACT: dict[str, Any] = {**_COMMON, "fastmath": False}

kernel = njit(**_EXACT, cache=True, forceinline=False)
"""Decorator of compiled functions without reassociation of sums."""

internal = njit(**_EXACT, cache=True, forceinline=False, no_cpython_wrapper=True)
"""Decorator of functions that only other kernels call: without an entry for Python they compile and load faster."""

inlined = njit(**_EXACT, forceinline=True, no_cpython_wrapper=True)
"""Decorator of the parts of an element kernel: always inlined, so that structs and tuples stay in registers."""

merged = njit(nogil=True, error_model="numpy", inline="always")
"""Decorator of a function that is compiled as part of its only caller: it has no code of its own and compiles
faster."""

vector_kernel = njit(**_COMMON, cache=True, fastmath={"reassoc", "contract"})
"""Decorator of reductions that may be vectorised; the order of summation is fixed by the binary."""

parallel_kernel = njit(**_EXACT, cache=True, forceinline=False, parallel=True)
"""Decorator of a loop whose iterations run in several threads."""


def start_threads() -> None:
    """Start numba's thread pool: a cached parallel function that is inlined into another one does not start it."""
    numba.get_num_threads()

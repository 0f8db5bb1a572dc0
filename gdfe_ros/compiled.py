# SPDX-License-Identifier: Apache-2.0
"""How the kernels are compiled: cached on disk, without the GIL, IEEE division instead of exceptions.

Numba recompiles a kernel when its own file changes, not when a constant or kernel that it imports does: after editing
one, delete the ``__pycache__`` folders (``make clean``).
"""

from __future__ import annotations

from typing import Any

import numba
from numba import njit

_COMMON: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
# Said outright: what is not set is inherited from the first caller, and results would depend on who that is.
_EXACT: dict[str, Any] = {**_COMMON, "fastmath": False}

kernel = njit(**_EXACT, cache=True, forceinline=False)
"""Decorator of every compiled function that needs no reassociation of sums."""

internal = njit(**_EXACT, cache=True, forceinline=False, no_cpython_wrapper=True)
"""Decorator of what only other kernels call: without an entry for Python it compiles and loads faster."""

inlined = njit(**_EXACT, forceinline=True, no_cpython_wrapper=True)
"""Decorator of the pieces of an element kernel: always inlined, so that structs and tuples stay in registers."""

merged = njit(nogil=True, error_model="numpy", inline="always")
"""Decorator of a function that is compiled as part of its only caller: no code of its own, which compiles faster."""

vector_kernel = njit(**_COMMON, cache=True, fastmath={"reassoc", "contract"})
"""Decorator of reductions that may be vectorised; the order of summation is fixed by the binary."""

parallel_kernel = njit(**_EXACT, cache=True, forceinline=False, parallel=True)
"""Decorator of a loop whose passes run in several threads at the same time."""


def start_threads() -> None:
    """Start numba's threads; one of its functions that comes from the cache as part of another does not."""
    numba.get_num_threads()

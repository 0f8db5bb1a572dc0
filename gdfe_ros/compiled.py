# SPDX-License-Identifier: Apache-2.0
"""Options of numba for the kernels: cached on disk, without the GIL, IEEE division instead of exceptions.

Numba recompiles a kernel when its own file changes, but not when an imported constant or kernel changes. After such a
change, delete the ``__pycache__`` folders (``make clean``).
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from numba import config, njit
from numpy.typing import NDArray

from gdfe_ros.compiling.linked import compile_linked

# Flags are explicit, because a kernel inherits unset ones from its first caller and its code would depend on that.
_EXACT: dict[str, Any] = {
    "nogil": True,
    "error_model": "numpy",
    "no_cfunc_wrapper": True,
    "fastmath": False,
    "forceinline": False,
}
_VECTOR: dict[str, Any] = {**_EXACT, "fastmath": {"reassoc", "contract"}}
_PART: dict[str, Any] = {"forceinline": True, "no_cpython_wrapper": True}
INLINED: dict[str, Any] = {**_EXACT, **_PART}
"""Options of functions that are always inlined."""

kernel = compile_linked(cache=True, **_EXACT)
"""Decorator of compiled functions without reassociation of sums."""

internal = compile_linked(cache=True, **_EXACT, no_cpython_wrapper=True)
"""Decorator of functions that only other kernels call. Without an entry for Python they compile and load faster."""

inlined = compile_linked(cache=False, **INLINED)
"""Decorator of functions that are always inlined into kernels; this keeps structs and tuples in registers."""

merged = njit(nogil=True, error_model="numpy", inline="always")
"""Decorator of a function that is compiled as part of its only caller: it has no code of its own and compiles
faster."""

vector_kernel = compile_linked(cache=True, **_VECTOR)
"""Decorator of reductions that may be vectorised; the order of summation is fixed by the binary."""

vector_internal = compile_linked(cache=True, **_VECTOR, no_cpython_wrapper=True)
"""Decorator of `vector_kernel` for functions that only other kernels call."""

vector_inlined = compile_linked(cache=False, **{**_VECTOR, **_PART})
"""Decorator of the parts of a `vector_kernel` that are always inlined."""

parallel_kernel = compile_linked(cache=True, **_EXACT, parallel=True)
"""Decorator of a loop whose iterations run in several threads."""


def allocate_record(kind: np.dtype) -> NDArray[np.void]:
    """Return an array (1,) of zeros with the fields of ``kind``, for kernels that read them as attributes.

    Where kernels are not compiled (NUMBA_DISABLE_JIT), Python reads them, and needs a record array. numba would take
    much longer to recognise such an array in each call.
    """
    found = np.zeros(1, dtype=kind)
    return found.view(np.recarray) if config.DISABLE_JIT else found


def start_threads() -> None:
    """Start numba's thread pool: a cached parallel function that is part of another kernel does not start it."""
    numba.get_num_threads()

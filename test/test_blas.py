# SPDX-License-Identifier: Apache-2.0
"""One thread for BLAS while a constant matrix is factored, and as many as before afterwards."""

from __future__ import annotations

import pytest
from threadpoolctl import ThreadpoolController

from gdfe_ros import threads as blas
from gdfe_ros.threads import one_blas_thread


def counts() -> set[int]:
    """Return the number of threads of each BLAS library."""
    return {library.num_threads for library in ThreadpoolController().select(user_api="blas").lib_controllers}


@pytest.fixture(autouse=True)
def _libraries_of_now() -> None:
    """Look for the libraries anew: another test of this process may have loaded one since."""
    blas._libraries.cache_clear()


def test_contexts_of_two_threads_may_overlap() -> None:
    """In overlapping contexts of two threads, BLAS has one thread until the second context ends, and then two again."""
    with ThreadpoolController().limit(limits=2, user_api="blas"):
        first, second = one_blas_thread(), one_blas_thread()
        first.__enter__()
        second.__enter__()
        first.__exit__(None, None, None)
        assert counts() == {1}
        second.__exit__(None, None, None)
        assert counts() == {2}

# SPDX-License-Identifier: Apache-2.0
"""Solution of a linear system with prescribed displacements."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.coarse_meshes.problem import Array
from benchmarks.peers.felupe_peer import fastest_solver


def displaced(stiffness: Any, given: Array, moved: Array, forces: Array) -> Array:
    """Return the displacements (k,) [m] of all degrees of freedom.

    Args:
        stiffness: sparse matrix (k, k) [N/m].
        given: prescribed degrees of freedom (g,).
        moved: displacements of the prescribed degrees of freedom (g,) [m].
        forces: forces (k,) [N] on the degrees of freedom; those on the prescribed ones are ignored.
    """
    displacement = np.zeros(len(forces))
    displacement[given] = moved
    free = np.setdiff1d(np.arange(len(forces)), given)
    if len(free) == 0:
        return displacement
    _, solver = fastest_solver()
    rows = stiffness[free]
    displacement[free] = solver(rows[:, free].tocsr(), forces[free] - rows[:, given] @ moved)
    return displacement

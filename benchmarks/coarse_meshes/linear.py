# SPDX-License-Identifier: Apache-2.0
"""The linear solve of a problem."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.coarse_meshes.problem import Array
from benchmarks.peers.felupe_peer import fastest_solver


def displaced(stiffness: Any, given: Array, moved: Array, forces: Array) -> Array:
    """Return the displacements (k,) [m] where some are given and forces (k,) [N] act on the others.

    Args:
        stiffness: (k, k) sparse [N/m].
        given: (g,) degrees of freedom.
        moved: (g,) their displacements [m].
        forces: (k,) [N].
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

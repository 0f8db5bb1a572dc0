# SPDX-License-Identifier: Apache-2.0
"""Compiled L-BFGS direction: the two-loop recursion (Nocedal 1980) around any initial matrix M.

With the pairs s of steps and y of changes of the gradient g, and from the newest pair to the oldest,

    q = g,    a_i = s_i . q / s_i . y_i,    q -= a_i y_i,

then z = M^-1 q, and from the oldest pair to the newest

    z += (a_i - y_i . z / s_i . y_i) s_i.

The direction is d = -z. Because M enters only through the product M^-1 q, it may change from iteration to iteration.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import vector_internal, vector_kernel
from gdfe_ros.solver.descent.workspace import Workspace, numbers


@vector_kernel
def inner(a, b):
    """Return the inner product of two flat vectors."""
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@vector_internal
def begin_recursion(work):
    """Write q of the first loop to ``work.step``."""
    status, q = work.status[0], work.step
    for n in range(len(q)):
        q[n] = work.gradient[n]
    for k in range(status.count):
        i = (status.head - 1 - k) % len(work.curvature)
        share = inner(work.steps[i], q) / work.curvature[i]
        work.share[i] = share
        y = work.changes[i]
        for n in range(len(q)):
            q[n] -= share * y[n]


@vector_internal
def end_recursion(work, z):
    """Complete ``z`` = M^-1 q to the product of the inverse Hessian and the gradient by the second loop."""
    status = work.status[0]
    for k in range(status.count - 1, -1, -1):
        i = (status.head - 1 - k) % len(work.curvature)
        share = work.share[i] - inner(work.changes[i], z) / work.curvature[i]
        s = work.steps[i]
        for n in range(len(z)):
            z[n] += share * s[n]


@vector_internal
def remember(work):
    """Add the pair of the last accepted step to the history, if its curvature is positive; return whether it is."""
    status, curvature = work.status[0], 0.0
    for n in range(len(work.u)):
        curvature += work.direction[n] * (work.gradient[n] - work.old[n])
    if not curvature > 0.0:
        return False
    i = status.head
    s, y = work.steps[i], work.changes[i]
    for n in range(len(work.u)):
        s[n], y[n] = work.direction[n], work.gradient[n] - work.old[n]
    work.curvature[i] = curvature
    status.head = (i + 1) % len(work.curvature)
    status.count = min(status.count + 1, len(work.curvature))
    return True


def history(work: Workspace) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the steps and changes (k, 3 r) of the history, oldest first; copies."""
    status = numbers(work)
    rows = (int(status["head"]) - int(status["count"]) + np.arange(int(status["count"]))) % len(work.curvature)
    return work.steps[rows], work.changes[rows]


def load_history(work: Workspace, steps: NDArray[np.float64], changes: NDArray[np.float64]) -> None:
    """Set the history of a workspace to steps and changes (k, 3 r), oldest first."""
    status, count = numbers(work), len(steps)
    work.steps[:count], work.changes[:count] = steps, changes
    work.curvature[:count] = np.einsum("ki,ki->k", steps, changes)
    status["count"], status["head"] = count, count % len(work.curvature)

# SPDX-License-Identifier: Apache-2.0
"""Workspace of a minimisation: arrays that are allocated once, constant data, and the history of L-BFGS.

The direction follows from the two-loop recursion (Nocedal 1980) around any initial matrix M. Each pair consists of a
step s and the change y of the gradient g in it. From the newest pair to the oldest,

    q = g,    a_i = s_i . q / s_i . y_i,    q -= a_i y_i,

then z = M^-1 q, and from the oldest pair to the newest

    z += (a_i - y_i . z / s_i . y_i) s_i.

The direction is d = -z. Because M enters only through the product M^-1 q, it may change from iteration to iteration.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import allocate_record, vector_internal, vector_kernel
from gdfe_ros.solver.vectors import Array

MEMORY = 8
"""Number of pairs in the history. Between 5 and 14 the number of iterations hardly depends on it."""


STATUS = np.dtype(
    [
        ("energy", np.float64),  # [J]
        ("slope", np.float64),  # of the energy along the direction [J]
        ("step", np.float64),  # largest vertex displacement of the direction [m]
        ("before", np.float64),  # the same in the last iteration; infinite before the first one [m]
        ("rate", np.float64),  # ratio of the last two steps
        ("distance", np.float64),  # estimated distance to the equilibrium [m]
        ("scale", np.float64),  # factor of the constant matrix' inverse where it replaces the tangent
        ("turned", np.float64),  # bound of the displacement since the vertices' rotations were computed [m]
        ("nearest", np.float64),  # shortest step so far [m]
        ("reach", np.float64),  # displacement beyond which the body counts as running away [m]
        ("absolute", np.float64),  # sum of the elements' |energy| [J]
        ("outside", np.float64),  # size of the other terms' energies [J]
        ("grain", np.float64),  # rounding of the undeformed energy [J]
        ("count", np.int64),  # number of pairs in the history
        ("head", np.int64),  # row of the next pair
        ("wild", np.int64),  # 1 if the constant matrix replaces the tangent, because its steps are far too long
        ("made", np.int64),  # iterations of this minimisation
        ("since", np.int64),  # iterations since the matrix was made
        ("blocked", np.int64),  # successive searches whose full step had infinite energy
        ("plateau", np.int64),  # iterations since the energy fell or the steps halved
        ("ended", np.int64),  # an `Outcome`
    ]
)
"""Fields of a minimisation's status record."""


class Problem(NamedTuple):
    """Constant data of a minimisation.

    Attributes:
        shape, blocks: operators of the elements.
        material: (m,) int32 material of each element.
        pressure: (m,) [Pa] multipliers of the volumes.
        scale: (m,) hourglass stiffness divided by its initial value.
        table: the materials.
        watch: elements near folding, on which fold barriers act; minimisations extend the list.
        unknowns: the numbering of the unknowns.
        frame: commanded positions of the handles.
        terms: all terms other than the elements.
        threads: threads among which the elements are divided; None for one.
    """

    shape: tuple
    blocks: tuple
    material: NDArray[np.int32]
    pressure: Array
    scale: Array
    table: tuple
    watch: tuple
    unknowns: tuple
    frame: tuple
    terms: tuple
    threads: int | None


class Workspace(NamedTuple):
    """Work arrays of a minimisation. All of them are overwritten, and none is returned as a result.

    Attributes:
        u, gradient, step: (3 r,) unknowns [m], dE/du [N], and scratch of the two-loop recursion.
        trial, old: (3 r,) trial unknowns [m], and gradient of the last iteration [N].
        direction, curve: (3 r,) [m] d and c of the arc u + t d + t^2 c along which a search moves.
        x: (n, 3) positions of all vertices [m].
        force, energies: (m, c, 3) [N] and (m,) [J] of the elements at ``x``.
        outside: (n, 3) dE/dx [N] of the other terms.
        size: (1,) sum of the magnitudes of the other terms' energies [J].
        steps, changes: (memory, 3 r) pairs of the history: s [m], and the change y of the gradient [N].
        curvature, share: (memory,) s . y [J], and scratch of the two-loop recursion.
        status: (1,) record with the fields of `STATUS`.
    """

    u: Array
    gradient: Array
    step: Array
    trial: Array
    direction: Array
    curve: Array
    old: Array
    x: Array
    force: Array
    energies: Array
    outside: Array
    size: Array
    steps: Array
    changes: Array
    curvature: Array
    share: Array
    status: NDArray[np.void]


def allocate(rows: int, x: Array, cells: tuple[int, int], memory: int = MEMORY) -> Workspace:
    """Return a workspace for ``rows`` rows of unknowns, a body at ``x`` (n, 3) [m] and ``memory`` pairs of history.

    ``cells`` is (m, c): the number of elements, and of the corners of each.
    """
    return Workspace(
        *(np.zeros(3 * rows) for _ in range(7)),
        x.copy(),
        np.zeros((*cells, 3)),
        np.zeros(cells[0]),
        np.zeros_like(x),
        np.zeros(1),
        *(np.zeros((memory, 3 * rows)) for _ in range(2)),
        *(np.zeros(memory) for _ in range(2)),
        allocate_record(STATUS),
    )


@vector_kernel
def inner(a, b):
    """Return the inner product of two flat vectors."""
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@vector_internal
def begin_recursion(work):
    """Do the first loop of the two-loop recursion: write q to ``work.step``."""
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
    """Do the second loop of the two-loop recursion: update ``z`` = M^-1 q in place."""
    status = work.status[0]
    for k in range(status.count - 1, -1, -1):
        i = (status.head - 1 - k) % len(work.curvature)
        share = work.share[i] - inner(work.changes[i], z) / work.curvature[i]
        s = work.steps[i]
        for n in range(len(z)):
            z[n] += share * s[n]


@vector_internal
def remember(work):
    """Add the last accepted step's pair to the history if its curvature s . y is positive; return whether it is."""
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


def history(work: Workspace) -> tuple[Array, Array]:
    """Return the steps and changes (k, 3 r) of the history, oldest first; copies."""
    status = work.status[0]
    rows = (int(status["head"]) - int(status["count"]) + np.arange(int(status["count"]))) % len(work.curvature)
    return work.steps[rows], work.changes[rows]


def load_history(work: Workspace, steps: Array, changes: Array) -> None:
    """Set the history of a workspace to steps and changes (k, 3 r), oldest first."""
    status, count = work.status[0], len(steps)
    work.steps[:count], work.changes[:count] = steps, changes
    work.curvature[:count] = np.einsum("ki,ki->k", steps, changes)
    status["count"], status["head"] = count, count % len(work.curvature)

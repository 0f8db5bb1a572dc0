# SPDX-License-Identifier: Apache-2.0
"""The workspace of a minimisation: its arrays, allocated once, and what stays constant while it runs."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

MEMORY, LONG_MEMORY = 14, 30
"""Pairs that the history keeps; the long one where forces act from outside: what they move most are the body's softest
modes, which the constant matrix takes for stiff and only the history knows."""
WINDOW = 10
"""Iterations whose longest step tells, beside that of as many before them, how fast the steps shrink."""


class End(IntEnum):
    """Why a descent cannot go on."""

    NONE = 0
    """It can."""
    STALLED = 1
    """No step along the direction lowers the energy."""
    EXHAUSTED = 2
    """The precision of the energy and its gradient is used up."""
    RUNAWAY = 3
    """The energy has no lower bound: an unstable law or load."""


STATUS = np.dtype(
    [
        ("energy", np.float64),  # [J]
        ("slope", np.float64),  # of the energy along the direction [J]
        ("distance", np.float64),  # largest vertex displacement of the quasi-Newton step [m]
        ("nearest", np.float64),  # least of these so far [m]
        ("reach", np.float64),  # of these: beyond it the body counts as running away [m]
        ("absolute", np.float64),  # sum of the elements' |energy| [J]
        ("outside", np.float64),  # size of the other terms' energies [J]
        ("grain", np.float64),  # rounding of the energy at rest [J]
        ("count", np.int64),  # pairs in the history
        ("serial", np.int64),  # of the newest pair ever remembered
        ("pending", np.int64),  # 1 where the newest pair's products with the older ones are still to come
        ("blocked", np.int64),  # searches in a row whose full step had infinite energy
        ("plateau", np.int64),  # iterations since the energy fell or the steps halved
        ("seen", np.int64),  # steps seen in this solve; -1 where nobody watches them
        ("evaluations", np.int64),  # of all elements
        ("ended", np.int64),  # an `End`
        ("given", np.int64),  # 1 where the next direction is given, and not found from the history
    ]
)
"""The numbers of a descent."""


class Problem(NamedTuple):
    """What stays constant during a descent.

    Attributes:
        shape, blocks: operators of the elements.
        material: (m,) int32 material of each element.
        pressure: (m,) [Pa] that carries the volume.
        scale: (m,) hourglass stiffness over that at rest.
        table: the materials.
        watch: over elements whose walls keep them from folding; descents add to it.
        unknowns: the numbering.
        frame: where handles are commanded.
        terms: all terms beside the elements.
        threads: that share the elements; None for one.
    """

    shape: tuple
    blocks: tuple
    material: NDArray[np.int32]
    pressure: NDArray[np.float64]
    scale: NDArray[np.float64]
    table: tuple
    watch: tuple
    unknowns: tuple
    frame: tuple
    terms: tuple
    threads: int | None


class Workspace(NamedTuple):
    """What a descent works in; all arrays are overwritten, and none outlives a solve as a result.

    Attributes:
        u, gradient, step: (3 r,) unknowns [m], dE/du [N], H_0 dE/du [m], row by row.
        trial, direction, old: (3 r,) work.
        x: (n, 3) positions of all vertices [m].
        force, energies: (m, 8, 3) [N] and (m,) [J] of the elements at ``x``.
        outside: (n, 3) dE/dx [N] of the other terms.
        size: (1,) size of their energies [J].
        steps, images: (memory, 3 r) histories s and v = H_0 y; pair i lies in row ``row[i]``.
        row: (memory,) int32, a permutation.
        serial: (memory,) int64 number of the pair in each row.
        triangle, gram: (memory, memory) s_i . y_j and y_i . v_j.
        products: (4, memory) s_i . g and v_i . g at the last iteration, and work.
        recent: (2 WINDOW,) displacements [m] of the last steps, in a ring.
        status: (1,) of `STATUS`.
    """

    u: NDArray[np.float64]
    gradient: NDArray[np.float64]
    step: NDArray[np.float64]
    trial: NDArray[np.float64]
    direction: NDArray[np.float64]
    old: NDArray[np.float64]
    x: NDArray[np.float64]
    force: NDArray[np.float64]
    energies: NDArray[np.float64]
    outside: NDArray[np.float64]
    size: NDArray[np.float64]
    steps: NDArray[np.float64]
    images: NDArray[np.float64]
    row: NDArray[np.int32]
    serial: NDArray[np.int64]
    triangle: NDArray[np.float64]
    gram: NDArray[np.float64]
    products: NDArray[np.float64]
    recent: NDArray[np.float64]
    status: NDArray[np.void]


def numbers(work: Workspace) -> np.void:
    """Return the numbers of a descent by the names of `STATUS`, to read and write faster than through the record."""
    return work.status.view(STATUS, np.ndarray)[0]


def allocate(rows: int, x: NDArray[np.float64], elements: int, memory: int = MEMORY) -> Workspace:
    """Allocate for ``rows`` rows of unknowns, a body at ``x`` (n, 3) [m] and a history of ``memory`` pairs."""
    return _with_history(rows, memory, x.copy(), np.zeros((elements, 8, 3)), np.zeros(elements), np.zeros_like(x))


def allocate_part(rows: int, whole: Workspace) -> Workspace:
    """Allocate for fewer ``rows``, sharing positions and what acts on them with the ``whole``."""
    return _with_history(rows, len(whole.row), whole.x, whole.force, whole.energies, whole.outside)


def _with_history(rows: int, memory: int, *shared: NDArray[np.float64]) -> Workspace:
    return Workspace(
        *(np.zeros(3 * rows) for _ in range(6)),
        *shared,
        np.zeros(1),
        *(np.zeros((memory, 3 * rows)) for _ in range(2)),
        np.arange(memory, dtype=np.int32),
        np.zeros(memory, dtype=np.int64),
        *(np.zeros((memory, memory)) for _ in range(2)),
        np.zeros((4, memory)),
        np.zeros(2 * WINDOW),
        np.zeros(1, dtype=STATUS).view(np.recarray),
    )

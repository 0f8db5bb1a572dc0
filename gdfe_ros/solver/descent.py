# SPDX-License-Identifier: Apache-2.0
"""Where a minimisation stands: its arrays, allocated once, and what stays constant while it runs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

MEMORY, LONG_MEMORY = 14, 30
"""Pairs that the history keeps; the long one where forces act from outside: what they move most are the body's softest
modes, which the constant matrix takes for stiff and only the history knows."""
ENERGY, COUNT, EVALUATIONS, STALLED, SLOPE, DISTANCE, OUTSIDE, BLOCKED = range(8)
PENDING, ABSOLUTE, NEAREST, FLAT, REACH, GRAIN, SEEN, RING = range(8, 16)
"""Entries of ``Descent.status``."""
WINDOW = 10
"""Iterations whose longest step tells, beside that of as many before them, how fast the steps shrink."""
EXHAUSTED, RUNAWAY = 2.0, 3.0
"""Values of ``STALLED`` where the precision of the energy and its gradient is used up, and where the energy has no
lower bound: an unstable law or load."""


class Problem(NamedTuple):
    """What stays constant during a minimisation: elements, materials, unknowns and plates, and in how many threads."""

    shape: tuple
    blocks: tuple
    material: NDArray[np.int32]
    pressure: NDArray[np.float64]
    share: NDArray[np.float64]
    table: tuple
    unknowns: tuple
    base: NDArray[np.float64]
    threads: int | None


class Descent(NamedTuple):
    """Where a minimisation stands; all arrays are allocated once and overwritten.

    Attributes:
        u, gradient, step: (3 r,) unknowns [m], dE/du [N], A^-1 dE/du [m], row by row.
        trial, direction, old: (3 r,) work.
        x: (n, 3) positions of all vertices [m].
        force, energies: (m, 8, 3) [N] and (m,) [J] of the elements at ``x``.
        outside: (n, 3) dE/dx [N] of what acts from outside.
        steps, images: (memory, 3 r) histories s and v = A^-1 y; pair i lies in row ``row[i]``.
        row: (memory,) int32, a permutation.
        triangle, gram: (memory, memory) s_i . y_j and y_i . v_j.
        products: (4, memory) s_i . g and v_i . g at the last iteration, and work.
        status: (16 + 2 WINDOW,) float64 energy [J], pairs in the history, evaluations, 1 where no descent is left and 2
            where precision is used up, slope of the energy along the direction [J], largest vertex displacement of the
            quasi-Newton step [m], size of the energy's terms from outside [J], searches in a row whose full step had
            infinite energy, 1 where the newest pair's products with the older ones are still to come, sum of the
            elements' |energy| [J], least displacement of a step so far [m], iterations since that or the energy fell,
            displacement of a step at which the body counts as running away [m], rounding of the energy at rest [J],
            steps seen in this solve or -1 where nobody watches them, and the displacements [m] of the last of them, in
            a ring.
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
    steps: NDArray[np.float64]
    images: NDArray[np.float64]
    row: NDArray[np.int32]
    triangle: NDArray[np.float64]
    gram: NDArray[np.float64]
    products: NDArray[np.float64]
    status: NDArray[np.float64]


def allocate(rows: int, x: NDArray[np.float64], elements: int, memory: int = MEMORY) -> Descent:
    """Allocate the arrays of a minimisation with ``rows`` rows of unknowns and a history of ``memory`` pairs."""
    return _with_history(rows, memory, x.copy(), np.zeros((elements, 8, 3)), np.zeros(elements), np.zeros_like(x))


def allocate_part(rows: int, whole: Descent) -> Descent:
    """Allocate a minimisation of fewer ``rows`` that shares positions and what acts on them with the ``whole``."""
    return _with_history(rows, len(whole.row), whole.x, whole.force, whole.energies, whole.outside)


def _with_history(rows: int, memory: int, *shared: NDArray[np.float64]) -> Descent:
    work = [np.zeros(3 * rows) for _ in range(6)]
    history = [np.zeros((memory, 3 * rows)) for _ in range(2)]
    square = [np.zeros((memory, memory)) for _ in range(2)]
    row = np.arange(memory, dtype=np.int32)
    return Descent(*work, *shared, *history, row, *square, np.zeros((4, memory)), np.zeros(RING + 2 * WINDOW))

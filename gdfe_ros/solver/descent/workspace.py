# SPDX-License-Identifier: Apache-2.0
"""Workspace of a minimisation: its arrays, allocated once, and its constant data."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

MEMORY, LONG_MEMORY = 14, 30
"""Largest number of pairs in the history, without and with external forces. Forces excite the softest modes most. The
constant matrix makes these modes too stiff, and only the history resolves them.
"""
WINDOW = 10
"""Number of iterations in a window. The longest steps of the last two windows give the rate at which steps shrink."""


class End(IntEnum):
    """Why a minimisation cannot continue."""

    NONE = 0
    """It can continue."""
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
        ("length", np.float64),  # t at the end of the last search
        ("distance", np.float64),  # largest vertex displacement of the quasi-Newton step [m]
        ("nearest", np.float64),  # least distance so far [m]
        ("reach", np.float64),  # displacement beyond which the body counts as running away [m]
        ("absolute", np.float64),  # sum of the elements' |energy| [J]
        ("outside", np.float64),  # size of the other terms' energies [J]
        ("grain", np.float64),  # rounding of the undeformed energy [J]
        ("count", np.int64),  # number of pairs in the history
        ("serial", np.int64),  # serial number of the newest pair
        ("pending", np.int64),  # 1 if the newest pair's products with the older ones are not computed yet
        ("blocked", np.int64),  # successive searches whose full step had infinite energy
        ("plateau", np.int64),  # iterations since the energy fell or the steps halved
        ("seen", np.int64),  # steps recorded in this solve; -1 if they are not recorded
        ("evaluations", np.int64),  # of all elements
        ("ended", np.int64),  # an `End`
        ("given", np.int64),  # 1 if the next direction is given instead of computed from the history
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
        watch: elements near folding, on which fold barriers act; minimisations add to them.
        unknowns: the numbering of the unknowns.
        frame: commanded positions of the handles.
        terms: all terms other than the elements.
        threads: threads among which the elements are divided; None for one.
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
    """Work arrays of a minimisation. All of them are overwritten, and none is returned as a result.

    Attributes:
        u, gradient, step: (3 r,) unknowns [m], dE/du [N], H_0 dE/du [m], row by row.
        trial, old: (3 r,) trial unknowns [m], and gradient of the last iteration [N].
        direction, curve: (3 r,) [m] d and c of the arc u + t d + t^2 c along which a search moves; c is zero except in
            Newton steps.
        x: (n, 3) positions of all vertices [m].
        force, energies: (m, c, 3) [N] and (m,) [J] of the elements at ``x``.
        outside: (n, 3) dE/dx [N] of the other terms.
        size: (1,) sum of the magnitudes of the other terms' energies [J].
        steps, images: (memory, 3 r) [m] pairs s and v = H_0 y of the history; pair i is stored in row ``row[i]``.
        row: (memory,) int32, a permutation.
        serial: (memory,) int64 serial number of the pair in each row.
        triangle, gram: (memory, memory) s_i . y_j and y_i . v_j [J].
        products: (4, memory) s_i . g and v_i . g [J] at the last iteration, and two rows of scratch.
        recent: (2 WINDOW,) displacements [m] of the last steps, as a ring buffer.
        status: (1,) record with the fields of `STATUS`.
    """

    u: NDArray[np.float64]
    gradient: NDArray[np.float64]
    step: NDArray[np.float64]
    trial: NDArray[np.float64]
    direction: NDArray[np.float64]
    curve: NDArray[np.float64]
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
    """Return a view of the fields of `STATUS`; it is faster to read and write than the record array."""
    return work.status.view(STATUS, np.ndarray)[0]


def allocate(rows: int, x: NDArray[np.float64], cells: tuple[int, int], memory: int = MEMORY) -> Workspace:
    """Return a workspace for ``rows`` rows of unknowns, a body at ``x`` (n, 3) [m] and ``memory`` pairs of history.

    ``cells`` is (m, c): the number of elements, and of the corners of each.
    """
    return _with_history(rows, memory, x.copy(), np.zeros((*cells, 3)), np.zeros(cells[0]), np.zeros_like(x))


def allocate_part(rows: int, whole: Workspace) -> Workspace:
    """Return a workspace for fewer ``rows`` that uses the positions, forces and energies of the ``whole`` body."""
    return _with_history(rows, len(whole.row), whole.x, whole.force, whole.energies, whole.outside)


def _with_history(rows: int, memory: int, *shared: NDArray[np.float64]) -> Workspace:
    return Workspace(
        *(np.zeros(3 * rows) for _ in range(7)),
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

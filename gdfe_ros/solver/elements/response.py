# SPDX-License-Identifier: Apache-2.0
"""Compiled element response: energy and corner forces of every element at given positions."""

from __future__ import annotations

from numba import prange

from gdfe_ros.compiled import kernel, parallel_kernel
from gdfe_ros.solver.elements.cell_kernels import add_walls, evaluate_blocks


@parallel_kernel
def evaluate_in_threads(threads, x, shape, blocks, material, pressure, scale, table, force, energy):
    """Evaluate all blocks by `evaluate_blocks`, with the blocks divided equally among ``threads``."""
    count = len(blocks.element)
    for part in prange(threads):
        first, last = part * count // threads, (part + 1) * count // threads
        evaluate_blocks(first, last, x, shape, blocks, material, pressure, scale, table, force, energy)


@kernel
def evaluate(x, shape, blocks, material, pressure, scale, table, watched, force, energy, threads):
    """Write the corner forces (m, c, 3) [N] and energies (m,) [J] of all elements; return the sum of the energies.

    ``x`` (n, 3) [m] are the positions, and ``pressure`` (m,) [Pa] the multipliers of the volumes. ``scale`` (m,)
    multiplies the initial hourglass stiffness. ``watched`` (k,) int32 are the elements with fold barriers. The result
    does not depend on the number of ``threads``, bit by bit. None means one thread, without compiling the parallel
    version.
    """
    if threads is None:
        evaluate_blocks(0, len(blocks.element), x, shape, blocks, material, pressure, scale, table, force, energy)
    else:
        evaluate_in_threads(threads, x, shape, blocks, material, pressure, scale, table, force, energy)
    if len(watched):
        add_walls(x, watched, shape, material, table, force, energy)
    total = 0.0
    for e in range(len(energy)):
        total += energy[e]
    return total

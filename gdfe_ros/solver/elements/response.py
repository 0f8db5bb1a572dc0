# SPDX-License-Identifier: Apache-2.0
"""Compiled element response: energy and corner forces of every element at given positions."""

from __future__ import annotations

import math

import numpy as np
from numba import prange

from gdfe_ros.compiled import inlined, internal, kernel, parallel_kernel
from gdfe_ros.materials.stress import (
    CURVE_FACTOR,
    corotated,
    curve_state,
    linear_factor,
    neo_hookean,
    ogden,
    volumetric,
)
from gdfe_ros.materials.table import LAME, PENALTY, POISSON, SHEAR, YOUNG
from gdfe_ros.materials.tensor import (
    cofactor,
    determinant,
    rotation_from_stretch_sum,
    squared_norm,
    stretch_sum,
)
from gdfe_ros.solver.elements.blocks import AXES, COUPLING, EDGES, GEOMETRY_ROWS, LANES, VOLUME
from gdfe_ros.solver.elements.corners import gather, scatter
from gdfe_ros.solver.elements.hourglass import hourglass
from gdfe_ros.solver.elements.lanes import (
    ENERGY,
    FORCES,
    GRADIENT,
    LAME_ROW,
    MODES,
    PENALTY_ROW,
    POISSON_ROW,
    PRESSURE,
    ROWS,
    SCALED_SHEAR,
    SHEAR_ROW,
    STRESS,
    YOUNG_ROW,
    load3,
    load9,
    store3,
    store9,
)

LINEAR, NEO_HOOKEAN, CURVE, OGDEN_LAW = 0, 1, 2, 3
UNIQUE = 1e-6
"""Margin of the rotation below which its closed form loses digits and the invariants are used for the energy."""


@inlined
def density(f, pressure, table, k):
    """Return the energy density [J/m^3] and the first Piola-Kirchhoff stress [Pa] of material ``k`` at F.

    The neo-Hookean law has a kernel of its own.
    """
    c = cofactor(f)
    j = determinant(f, c)
    law = table.law[k]
    if law == OGDEN_LAW:
        return ogden(f, c, j, pressure, table, k)
    first = squared_norm(f)
    second = squared_norm(c)
    s = stretch_sum(first, second, j)
    r, margin = rotation_from_stretch_sum(f, c, first, s, j)
    lam = s / 3.0
    deviator = corotated(f, r, lam, 1.0, 0.0, c)
    size = squared_norm(deviator) if margin > UNIQUE else max(first - s * lam, 0.0)
    energy, slope = volumetric(j, pressure, table, k)
    if law == CURVE:
        phi, secant, _ = curve_state(math.sqrt(CURVE_FACTOR * size), table, k)
        return energy + phi, corotated(f, r, lam, CURVE_FACTOR * secant, slope, c)
    factor = linear_factor(table, k)
    return energy + 0.5 * factor * size, corotated(f, r, lam, factor, slope, c)


@inlined
def load_parameters(b, elements, material, pressure, scale, table):
    """Copy what the lanes' materials need into their rows."""
    for lane in range(LANES):
        e = elements[lane]
        k = material[e]
        b[PRESSURE * LANES + lane] = pressure[e]
        b[SHEAR_ROW * LANES + lane] = table.parameters[k, SHEAR]
        b[LAME_ROW * LANES + lane] = table.parameters[k, LAME]
        b[PENALTY_ROW * LANES + lane] = table.parameters[k, PENALTY]
        b[YOUNG_ROW * LANES + lane] = scale[e] * table.parameters[k, YOUNG]
        b[SCALED_SHEAR * LANES + lane] = scale[e] * table.parameters[k, SHEAR]
        b[POISSON_ROW * LANES + lane] = table.parameters[k, POISSON]


@inlined
def stress_rows(b, law, elements, material, pressure, table):
    """Write the rows of the energy density and of P of a block."""
    if law == NEO_HOOKEAN:
        for lane in range(LANES):
            f = load9(b, GRADIENT, lane)
            w, p = neo_hookean(
                f,
                b[PRESSURE * LANES + lane],
                b[SHEAR_ROW * LANES + lane],
                b[LAME_ROW * LANES + lane],
                b[PENALTY_ROW * LANES + lane],
            )
            b[ENERGY * LANES + lane] = w
            store9(b, STRESS, lane, p)
    else:
        for lane in range(LANES):
            e = elements[lane]
            w, p = density(load9(b, GRADIENT, lane), pressure[e], table, material[e])
            b[ENERGY * LANES + lane] = w
            store9(b, STRESS, lane, p)


@inlined
def hourglass_rows(b, geometry, offset):
    """Add the hourglass part of a block: rows of forces, of V P and of the energy [J]."""
    for lane in range(LANES):
        volume = geometry[offset + VOLUME * LANES + lane]
        q = (
            load3(b, MODES, lane),
            load3(b, MODES + 3, lane),
            load3(b, MODES + 6, lane),
            load3(b, MODES + 9, lane),
        )
        energy, h, s = hourglass(
            load9(b, GRADIENT, lane),
            q,
            load9(geometry, AXES, offset + lane),
            load3(geometry, EDGES, offset + lane),
            geometry[offset + COUPLING * LANES + lane],
            volume * b[YOUNG_ROW * LANES + lane],
            volume * b[SCALED_SHEAR * LANES + lane],
            b[POISSON_ROW * LANES + lane],
        )
        p = load9(b, STRESS, lane)
        store9(b, STRESS, lane, corotated(p, p, 0.0, volume, 1.0, s))
        for mode in range(4):
            store3(b, FORCES + 3 * mode, lane, h[mode])
        b[ENERGY * LANES + lane] = volume * b[ENERGY * LANES + lane] + energy


@internal
def evaluate_blocks(first, last, x, shape, blocks, material, pressure, scale, table, force, energy):
    """Do what `evaluate` does for the blocks from ``first`` up to ``last``, without the sum."""
    b = np.empty(ROWS * LANES)
    for block in range(first, last):
        elements = blocks.element[block]
        gather(b, x, shape, blocks, block)
        load_parameters(b, elements, material, pressure, scale, table)
        stress_rows(b, blocks.law[block], elements, material, pressure, table)
        hourglass_rows(b, blocks.geometry, block * GEOMETRY_ROWS * LANES)
        scatter(b, force, shape, blocks, block)
        for lane in range(blocks.used[block]):
            energy[elements[lane]] = b[ENERGY * LANES + lane]


@parallel_kernel
def evaluate_in_threads(threads, x, shape, blocks, material, pressure, scale, table, force, energy):
    """Share all blocks out to threads in equal parts."""
    count = len(blocks.element)
    for part in prange(threads):
        first, last = part * count // threads, (part + 1) * count // threads
        evaluate_blocks(first, last, x, shape, blocks, material, pressure, scale, table, force, energy)


@kernel
def evaluate(x, shape, blocks, material, pressure, scale, table, force, energy, threads):
    """Write the corner forces (m, 8, 3) [N] and energies (m,) [J] of all elements; return the sum of the energies.

    ``x`` (n, 3) [m] are the positions, ``pressure`` (m,) [Pa] carries the volume, ``scale`` (m,) scales the hourglass
    stiffness at rest. With any number of ``threads`` the same code writes the same bits, and the sum is taken in one;
    None, for one thread, spares the compilation of the other way.
    """
    if threads is None:
        evaluate_blocks(0, len(blocks.element), x, shape, blocks, material, pressure, scale, table, force, energy)
    else:
        evaluate_in_threads(threads, x, shape, blocks, material, pressure, scale, table, force, energy)
    total = 0.0
    for e in range(len(energy)):
        total += energy[e]
    return total

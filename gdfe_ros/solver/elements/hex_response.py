# SPDX-License-Identifier: Apache-2.0
"""Compiled response of hexahedra: energy and corner forces of blocks at given positions (see `cell_kernels`)."""

from __future__ import annotations

import numpy as np

from gdfe_ros.compiled import inlined, internal
from gdfe_ros.materials.stress import corotated
from gdfe_ros.materials.table import LAME, PENALTY, POISSON, SHEAR, YOUNG
from gdfe_ros.solver.elements.blocks import AXES, COUPLING, EDGES, LANES, VOLUME
from gdfe_ros.solver.elements.corners import gather, scatter
from gdfe_ros.solver.elements.hourglass import hourglass
from gdfe_ros.solver.elements.lanes import (
    ENERGY,
    FORCES,
    GEOMETRY,
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
from gdfe_ros.solver.elements.stress_rows import stress_rows


@inlined
def load_parameters(b, elements, material, pressure, scale, table):
    """Copy the parameters of the lanes' materials into their rows."""
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
def hourglass_rows(b):
    """Write a block's hourglass forces [N]. Turn its rows of stress P and energy density into V P [N m] and energy [J].

    Both include the hourglass part.
    """
    for lane in range(LANES):
        volume = b[(GEOMETRY + VOLUME) * LANES + lane]
        q = (
            load3(b, MODES, lane),
            load3(b, MODES + 3, lane),
            load3(b, MODES + 6, lane),
            load3(b, MODES + 9, lane),
        )
        energy, h, s = hourglass(
            load9(b, GRADIENT, lane),
            q,
            load9(b, GEOMETRY + AXES, lane),
            load3(b, GEOMETRY + EDGES, lane),
            b[(GEOMETRY + COUPLING) * LANES + lane],
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
    """Write corner forces (m, 8, 3) [N] and energies (m,) [J] of the blocks from ``first`` up to ``last``."""
    b = np.empty(ROWS * LANES)
    for block in range(first, last):
        elements = blocks.element[block]
        gather(b, x, shape, blocks, block)
        load_parameters(b, elements, material, pressure, scale, table)
        stress_rows(b, blocks.law[block], elements, material, table)
        hourglass_rows(b)
        scatter(b, force, shape, blocks, block)
        for lane in range(blocks.used[block]):
            energy[elements[lane]] = b[ENERGY * LANES + lane]

# SPDX-License-Identifier: Apache-2.0
"""Compiled stresses of a block of elements of one law, in several passes.

A lane is one element of a block. A pass over the lanes without calls and branches is compiled to SIMD. Logarithms,
powers and table look-ups of a law therefore have a pass of their own. In an iterative method, each iteration is a pass;
a converged lane keeps its value until all lanes have converged.
"""

from __future__ import annotations

import math

from gdfe_ros.compiled import inlined, internal
from gdfe_ros.materials.material import Law
from gdfe_ros.materials.stress import (
    CURVE_FACTOR,
    corotated_stress,
    curve_state,
    neo_hookean,
    ogden_continued,
    stable_neo_hookean,
    volumetric,
)
from gdfe_ros.materials.table import POISSON, YOUNG
from gdfe_ros.materials.tensor import (
    NEWTON_STEPS,
    cofactor,
    determinant,
    jacobi_sweep,
    off_diagonal,
    perpendicular,
    rotation_from_stretch_sum,
    scale_vector,
    squared_norm,
    stretch_sum_step,
    times,
)
from gdfe_ros.mesh.triples import combine, cross, dot
from gdfe_ros.solver.elements.blocks import (
    COORDINATES,
    ENERGY,
    FORCES,
    GRADIENT,
    LANES,
    PENALTY_ROW,
    PRESSURE,
    STRESS,
    load3,
    load6,
    load9,
    store3,
    store9,
)

UNIQUE = 1e-6
"""If the rotation R of an element is hardly determined, its closed form loses digits. If the measure of its uniqueness
(see `rotation_from_stretch_sum`) is at most this, the squared norm |F - lam R|^2 is therefore computed from the
invariants of F.
"""
SWEEPS = 12
"""Limit of Jacobi sweeps. Three to five are enough for finite numbers; NaN ends the sweeps at once."""
FIRST, SECOND, DETERMINANT, STRETCH_SUM, SIZE, FACTOR, STORED = range(COORDINATES, COORDINATES + 7)
"""Scratch rows of the corotated laws: invariants of F (3), tr(R^T F), |F - lam R|^2, factor of F - lam R, energy."""
TENSOR, LEFT, RIGHT = COORDINATES, COORDINATES + 6, FORCES
"""Scratch rows of Ogden's law: C (6), then stretches and derivatives; eigenvectors N (9); n = F N / stretch (9)."""
STRETCHES, DERIVATIVES = TENSOR, TENSOR + 3


@inlined
def stress_rows(b, law, elements, material, table):
    """Write the rows of the energy density [J/m^3] and of P [Pa] of a block from its rows of F."""
    if law == Law.NEO_HOOKEAN:
        for lane in range(LANES):
            pressure, mu, lame, kappa = load4(b, PRESSURE, lane)
            store_law(b, lane, neo_hookean(load9(b, GRADIENT, lane), pressure, mu, lame, kappa))
    elif law == Law.STABLE_NEO_HOOKEAN:
        stable_neo_hookean_rows(b)
    elif law == Law.OGDEN:
        principal_rows(b)
        for lane in range(LANES):
            l0, l1, l2 = load3(b, STRETCHES, lane)
            energy, g = ogden_continued(l0, l1, l2, table, material[elements[lane]])
            b[ENERGY * LANES + lane] = energy
            store3(b, DERIVATIVES, lane, g)
        ogden_stress_rows(b)
    else:
        deviator_rows(b)
        for lane in range(LANES):
            k, size = material[elements[lane]], b[SIZE * LANES + lane]
            if law == Law.CURVE:
                stored, secant, _ = curve_state(math.sqrt(CURVE_FACTOR * size), table, k)
                factor = CURVE_FACTOR * secant
            else:
                factor = table.parameters[k, YOUNG] / (1.0 + table.parameters[k, POISSON])
                stored = 0.5 * factor * size
            b[FACTOR * LANES + lane], b[STORED * LANES + lane] = factor, stored
        corotated_stress_rows(b)


@internal
def stable_neo_hookean_rows(b):
    """Write the rows of the energy density and of P for the stable neo-Hookean law.

    This function is not inlined: otherwise each element kernel would compile a copy of it, for bodies of other laws,
    too.
    """
    for lane in range(LANES):
        pressure, mu, _, kappa = load4(b, PRESSURE, lane)
        store_law(b, lane, stable_neo_hookean(load9(b, GRADIENT, lane), pressure, mu, kappa))


@inlined
def store_law(b, lane, found):
    """Write the lane's energy density and P, ``found``."""
    b[ENERGY * LANES + lane] = found[0]
    store9(b, STRESS, lane, found[1])


@inlined
def load4(b, row, lane):
    """Return the lane's four numbers in the rows from ``row`` on."""
    i = row * LANES + lane
    return b[i], b[i + LANES], b[i + 2 * LANES], b[i + 3 * LANES]


@inlined
def deviator_rows(b):
    """Write F - lam R to the rows of P, and its squared norm to the row `SIZE`; lam is the mean stretch."""
    for lane in range(LANES):
        f = load9(b, GRADIENT, lane)
        c = cofactor(f)
        first = squared_norm(f)
        b[FIRST * LANES + lane], b[SECOND * LANES + lane] = first, squared_norm(c)
        b[DETERMINANT * LANES + lane] = determinant(f, c)
        b[STRETCH_SUM * LANES + lane], b[SIZE * LANES + lane] = math.sqrt(3.0 * first), 1.0
    for _ in range(NEWTON_STEPS):
        for lane in range(LANES):
            first, second, j, last = load4(b, FIRST, lane)
            s, going = stretch_sum_step(last, first, second, j)
            follows = b[SIZE * LANES + lane] != 0.0
            b[STRETCH_SUM * LANES + lane] = s if follows else last
            b[SIZE * LANES + lane] = 1.0 if going & follows else 0.0
        left = 0
        for lane in range(LANES):
            left += 1 if b[SIZE * LANES + lane] != 0.0 else 0
        if left == 0:
            break
    for lane in range(LANES):
        f, first, s = load9(b, GRADIENT, lane), b[FIRST * LANES + lane], b[STRETCH_SUM * LANES + lane]
        c = cofactor(f)
        r, margin = rotation_from_stretch_sum(f, c, first, s, b[DETERMINANT * LANES + lane])
        lam = s / 3.0
        deviator = corotated_stress(f, r, lam, 1.0, 0.0, c)
        exact, known = squared_norm(deviator), max(first - s * lam, 0.0)
        b[SIZE * LANES + lane] = exact if margin > UNIQUE else known
        store9(b, STRESS, lane, deviator)


@inlined
def corotated_stress_rows(b):
    """Write W and P = factor (F - lam R) + slope cof F from the rows of `deviator_rows`."""
    for lane in range(LANES):
        c = cofactor(load9(b, GRADIENT, lane))
        j = b[DETERMINANT * LANES + lane]
        energy, slope = volumetric(j, b[PRESSURE * LANES + lane], b[PENALTY_ROW * LANES + lane])
        b[ENERGY * LANES + lane] = energy + b[STORED * LANES + lane]
        d = load9(b, STRESS, lane)
        store9(b, STRESS, lane, corotated_stress(d, d, 0.0, b[FACTOR * LANES + lane], slope, c))


@inlined
def principal_rows(b):
    """Write the signed principal stretches, largest first, and their directions N (undeformed) and n (deformed)."""
    for lane in range(LANES):
        f = load9(b, GRADIENT, lane)
        x, y, z = (f[0], f[3], f[6]), (f[1], f[4], f[7]), (f[2], f[5], f[8])
        store3(b, TENSOR, lane, (dot(x, x), dot(x, y), dot(x, z)))
        store3(b, TENSOR + 3, lane, (dot(y, y), dot(y, z), dot(z, z)))
        store9(b, LEFT, lane, (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0))
    for _ in range(SWEEPS):
        left = 0
        for lane in range(LANES):
            left += 1 if off_diagonal(load6(b, TENSOR, lane)) else 0
        if left == 0:
            break
        for lane in range(LANES):
            a, v = jacobi_sweep(load6(b, TENSOR, lane), load9(b, LEFT, lane))
            store3(b, TENSOR, lane, (a[0], a[1], a[2]))
            store3(b, TENSOR + 3, lane, (a[3], a[4], a[5]))
            store9(b, LEFT, lane, v)
    for lane in range(LANES):
        a, v = load6(b, TENSOR, lane), load9(b, LEFT, lane)
        e0, p, e1, q = sort_pair(a[0], (v[0], v[3], v[6]), a[3], (v[1], v[4], v[7]))
        e1, q, _, _ = sort_pair(e1, q, a[5], (v[2], v[5], v[8]))
        e0, p, e1, q = sort_pair(e0, p, e1, q)
        f, l0, l1 = load9(b, GRADIENT, lane), math.sqrt(max(e0, 0.0)), math.sqrt(max(e1, 0.0))
        b[STRETCHES * LANES + lane], b[(STRETCHES + 1) * LANES + lane] = l0, l1
        store3(b, LEFT, lane, p)
        store3(b, LEFT + 3, lane, q)
        store3(b, RIGHT, lane, scale_vector(times(f, p), 1.0 / max(l0, 1e-150)))
        store3(b, RIGHT + 3, lane, scale_vector(times(f, q), 1.0 / max(l1, 1e-150)))
    for lane in range(LANES):
        if b[(STRETCHES + 1) * LANES + lane] <= 1e-9 * b[STRETCHES * LANES + lane]:
            store3(b, RIGHT + 3, lane, perpendicular(load3(b, RIGHT, lane)))
    for lane in range(LANES):
        last, normal = (
            cross(load3(b, LEFT, lane), load3(b, LEFT + 3, lane)),
            cross(load3(b, RIGHT, lane), load3(b, RIGHT + 3, lane)),
        )
        store3(b, LEFT + 6, lane, last)
        store3(b, RIGHT + 6, lane, normal)
        b[(STRETCHES + 2) * LANES + lane] = dot(normal, times(load9(b, GRADIENT, lane), last))


@inlined
def ogden_stress_rows(b):
    """Add the volume term to W, and write P = sum_i dW/dl_i n_i (x) N_i + slope cof F."""
    for lane in range(LANES):
        f = load9(b, GRADIENT, lane)
        c = cofactor(f)
        volume, slope = volumetric(determinant(f, c), b[PRESSURE * LANES + lane], b[PENALTY_ROW * LANES + lane])
        b[ENERGY * LANES + lane] = b[ENERGY * LANES + lane] + volume
        g, u, v = load3(b, DERIVATIVES, lane), load9(b, RIGHT, lane), load9(b, LEFT, lane)
        store3(b, STRESS, lane, stress_row(g, u, 0, v, slope, c[:3]))
        store3(b, STRESS + 3, lane, stress_row(g, u, 1, v, slope, c[3:6]))
        store3(b, STRESS + 6, lane, stress_row(g, u, 2, v, slope, c[6:]))


@inlined
def stress_row(g, u, i, v, slope, c):
    """Return row i of P from derivatives g (3), deformed directions u (9) and undeformed directions v (9)."""
    p = combine(g[0] * u[i], v[:3], g[1] * u[3 + i], v[3:6], g[2] * u[6 + i], v[6:])
    return p[0] + slope * c[0], p[1] + slope * c[1], p[2] + slope * c[2]


@inlined
def sort_pair(p, a, q, b):
    """Return two eigenvalues with their eigenvectors, the larger one first; without a branch."""
    swap = p < q
    larger, smaller = q if swap else p, p if swap else q
    first = (b[0] if swap else a[0], b[1] if swap else a[1], b[2] if swap else a[2])
    second = (a[0] if swap else b[0], a[1] if swap else b[1], a[2] if swap else b[2])
    return larger, first, smaller, second

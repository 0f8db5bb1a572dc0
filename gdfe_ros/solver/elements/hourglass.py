# SPDX-License-Identifier: Apache-2.0
"""Compiled hourglass energy of one element: assumed strains per mode type, in the element's current edge directions.

The four vectors q_k = sum_b gamma_kb x_b contain the deformation that the mean gradient does not. They are projected on
the current directions e_i = F d_i / |F d_i| of the three edges. A mode k < 3 does not vary along edge k. Its projection
on an edge i != k is bending: a normal strain 2 a / h_i along i that varies linearly along the third edge, with the
mode's amplitude a at the corners and the edge length h_i. Its projection on edge k is torsion, with shear strains. Mode
3 varies trilinearly. In bending, parasitic shear and thickness strains are left out (enhanced assumed strain:
Belytschko and Bindeman 1993, Puso 2000). The moduli are the initial moduli times the element's scale, which is constant
during a minimisation.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import inlined
from gdfe_ros.materials.tensor import scale_vector, times
from gdfe_ros.mesh.triples import along, combine, dot
from gdfe_ros.solver.vectors import Array

OWN_SHEAR = (6.0 * 0.14057702, 0.37384848, 0.22901768, 0.15517115)
"""Weight 1 - chi of the uncoupled shear strains in a twisted element, by the number of cells across a square bar. With
1, 2, 3 and 4 cells the torsion constant of the bar is Saint-Venant's 0.14057702 h^4 to the last digit, where h is its
width. For more than 4 cells the weight of 4 cells is used. The error of the torsion constant is then at most 0.2 %.
Smaller weights would resist hourglassing too little.
"""
AMPLITUDE = math.sqrt(0.125)
"""Size of the entries of a unit hourglass vector, and the amplitude of a mode whose projection on it is 1."""
LEAST_EDGE = 1e-3
"""Stretch e in the regularised length sqrt(|F d_i|^2 + e^2); with it, a collapsed edge keeps a finite direction."""


@inlined
def hourglass(f, q, axes, rates, coupling, young, shear, poisson):
    """Return energy [J], forces dE/dq (4 x 3) [N] and dE/dF (9) [N m] of the hourglass vectors q (4 x 3) [m] at F.

    ``axes`` (9) are the undeformed directions of the edges; ``rates`` (3) [1/m] are 2 / edge length. ``coupling`` is
    the coupling of shear strains in torsion. ``young`` and ``shear`` are moduli [Pa] times the element's volume.
    """
    a0, a1, a2 = axes[:3], axes[3:6], axes[6:]
    (d0, l0), (d1, l1), (d2, l2) = edge_direction(f, a0), edge_direction(f, a1), edge_direction(f, a2)
    w0, w1, w2 = scale_vector(rates, AMPLITUDE)
    energy, t0, t1, t2 = mode_forces(q, d0, d1, d2, w0, w1, w2, coupling, young, shear, poisson)
    h = (
        combine(t0[0], d0, t1[0], d1, t2[0], d2),
        combine(t0[1], d0, t1[1], d1, t2[1], d2),
        combine(t0[2], d0, t1[2], d1, t2[2], d2),
        combine(t0[3], d0, t1[3], d1, t2[3], d2),
    )
    m0, m1, m2 = turning(t0, q, d0, l0), turning(t1, q, d1, l1), turning(t2, q, d2, l2)
    s0 = combine(m0[0], a0, m1[0], a1, m2[0], a2)
    s1 = combine(m0[1], a0, m1[1], a1, m2[1], a2)
    s2 = combine(m0[2], a0, m1[2], a1, m2[2], a2)
    return energy, h, s0 + s1 + s2


@inlined
def mode_forces(q, d0, d1, d2, w0, w1, w2, coupling, young, shear, poisson):
    """Return the energy [J] and its derivatives [N] with respect to the projections d_i . q_k: four for each edge i.

    ``w_i`` (1/m) converts a projection to a strain along or across edge i.
    """
    plane, twist = young / (3.0 * (1.0 - poisson * poisson)), shear / 3.0
    triple = (young + 2.0 * shear) / 9.0
    x0, y1, z2 = dot(d0, q[0]), dot(d1, q[1]), dot(d2, q[2])
    g01, g12, g02 = x0 * w1 + y1 * w0, y1 * w2 + z2 * w1, x0 * w2 + z2 * w0
    own, total = 1.0 - coupling, coupling * (g01 + g12 + g02)
    energy = own * (g01 * g01 + g12 * g12 + g02 * g02) + total * (g01 + g12 + g02)
    energy *= 0.5 * twist
    g01, g12, g02 = twist * (own * g01 + total), twist * (own * g12 + total), twist * (own * g02 + total)
    e01, t01, t10 = bending(dot(d0, q[1]) * w0, dot(d1, q[0]) * w1, plane, poisson)
    e12, t12, t21 = bending(dot(d1, q[2]) * w1, dot(d2, q[1]) * w2, plane, poisson)
    e20, t20, t02 = bending(dot(d2, q[0]) * w2, dot(d0, q[2]) * w0, plane, poisson)
    s0, s1, s2 = dot(d0, q[3]) * w0, dot(d1, q[3]) * w1, dot(d2, q[3]) * w2
    energy += e01 + e12 + e20 + 0.5 * triple * (s0 * s0 + s1 * s1 + s2 * s2)
    return (
        energy,
        (g01 * w1 + g02 * w2, w0 * t01, w0 * t02, w0 * triple * s0),
        (w1 * t10, g01 * w0 + g12 * w2, w1 * t12, w1 * triple * s1),
        (w2 * t20, w2 * t21, g12 * w1 + g02 * w0, w2 * triple * s2),
    )


@inlined
def bending(a, b, plane, poisson):
    """Return energy and stresses of two normal strains that vary linearly along the third edge (plane stress)."""
    stress_a, stress_b = plane * (a + poisson * b), plane * (b + poisson * a)
    return 0.5 * (a * stress_a + b * stress_b), stress_a, stress_b


@inlined
def edge_direction(f, axis):
    """Return the current unit direction F d / |F d| of an edge, and 1 / |F d|; both are regularised by `LEAST_EDGE`."""
    d = times(f, axis)
    inverse = 1.0 / math.sqrt(dot(d, d) + LEAST_EDGE * LEAST_EDGE)
    return scale_vector(d, inverse), inverse


@inlined
def turning(t, q, d, inverse):
    """Return dE/d(F d_i); E depends on F d_i by its unit direction ``d`` alone, and ``t`` (4) are dE/d(d . q_k)."""
    m = along(1.0, combine(t[0], q[0], t[1], q[1], t[2], q[2]), t[3], q[3])
    return scale_vector(along(1.0, m, -dot(m, d), d), inverse)


def couplings(across: NDArray[np.int32]) -> Array:
    """Return the coupling chi (m,) of elements in sections that are ``across`` (m,) cells wide."""
    return (1.0 - np.array(OWN_SHEAR))[np.minimum(across, len(OWN_SHEAR)) - 1]

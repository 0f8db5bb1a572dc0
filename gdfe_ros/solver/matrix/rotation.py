# SPDX-License-Identifier: Apache-2.0
"""Compiled rotations: formulas for rotation vectors, and rotations of vertices since the tangent was evaluated.

For a rotation vector theta of length t, with the cross-product matrix [theta], exp([theta]) = I + a [theta] +
b [theta]^2 and J_l(theta) = I + b [theta] + c [theta]^2. Here a = sin t / t, b = (1 - cos t) / t^2 and
c = (t - sin t) / t^3. Then d exp([theta]) v = -[exp([theta]) v] J_l(theta) d theta (Chirikjian 2012).

Bending turns the stiff directions of a slender body into its soft ones. After a few degrees of rotation, a kept tangent
K0 is therefore far too soft. With the rotation R of each vertex, R K0 R^T follows such a motion, like the local
rotation fit of the elements in the paper.
"""

from __future__ import annotations

import math

import numpy as np

from gdfe_ros.compiled import inlined, internal, kernel
from gdfe_ros.materials.tensor import cofactor, determinant, rotation, scale_vector, times
from gdfe_ros.mesh.triples import combine, corner, cross
from gdfe_ros.solver.elements.corners import mean_gradient
from gdfe_ros.solver.vectors import Array, clear_part

SMALL = 1e-4
"""Below this angle [rad], the coefficients a, b and c are computed from two terms of their series, which are exact to
double precision.
"""


@inlined
def coefficients(turn):
    """Return the coefficients a, b and c of a rotation vector [rad]."""
    square = turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2]
    angle = math.sqrt(square)
    if angle < SMALL:
        return 1.0 - square / 6.0, 0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0
    return math.sin(angle) / angle, (1.0 - math.cos(angle)) / square, (angle - math.sin(angle)) / (square * angle)


@inlined
def rotation_matrix(turn):
    """Return the rotation matrix (9 numbers, row by row) of a rotation vector [rad]."""
    a, b, _ = coefficients(turn)
    x, y, z = turn
    return (
        1.0 - b * (y * y + z * z),
        b * x * y - a * z,
        b * x * z + a * y,
        b * x * y + a * z,
        1.0 - b * (x * x + z * z),
        b * y * z - a * x,
        b * x * z - a * y,
        b * y * z + a * x,
        1.0 - b * (x * x + y * y),
    )


@inlined
def left_jacobian_transposed(turn, moment):
    """Return J_l(theta)^T m for a rotation vector and a moment m: dE/d(rotation vector) if m is the moment of dE/dx."""
    _, b, c = coefficients(turn)
    across = cross(turn, moment)
    return combine(1.0, moment, -b, across, c, cross(turn, across))


UNIQUE = 0.05
"""A vertex counts as not rotated if its rotation is hardly determined: if the measure of its uniqueness (see
`rotation_from_stretch_sum`) is below this. Without deformation the measure is 8 / 27^(1/2).
"""
LEAST_TURN = 3e-3
"""If no vertex is rotated by more than this angle [rad], all vertices count as not rotated. In bodies whose stiffnesses
differ by ten decades, small differences between the rotations would make the tangent worse.
"""


@kernel
def vertex_rotations(x, before, shape, rows, held, sums, out):
    """Write the rotations (f, 9) of free vertices from ``before`` to ``x`` (n, 3) [m] to ``out``.

    The rotation of a vertex is that of the mean deformation gradient, relative to ``before``, of the elements at the
    vertex. If ``held`` is False, nothing holds the body, and all vertices get one common rotation: otherwise R K0 R^T
    would not conserve its momentum. ``sums`` (n, 9) is scratch.

    ``rows`` are `Unknowns.free` and `Unknowns.fixed`. Vertices on rollers count as not rotated: a rotation would mix
    their fixed axes with the others.
    """
    free, fixed = rows
    add_gradients(x, before, shape, sums)
    if not held:
        share_sum(sums)
    most = 0.0
    for i in range(len(free)):
        m = sums[free[i]]
        r, margin, _ = rotation((m[0], m[1], m[2], m[3], m[4], m[5], m[6], m[7], m[8]))
        for k in range(9):
            out[i, k] = r[k] if margin > UNIQUE else (1.0 if k % 4 == 0 else 0.0)
        most = max(most, 3.0 - out[i, 0] - out[i, 4] - out[i, 8])
    if most < LEAST_TURN * LEAST_TURN:
        for i in range(len(free)):
            for k in range(9):
                out[i, k] = 1.0 if k % 4 == 0 else 0.0
    for i in range(len(fixed)):
        for k in range(9):
            out[fixed[i] // 3, k] = 1.0 if k % 4 == 0 else 0.0


@internal
def add_gradients(x, before, shape, sums):
    """Sum the deformation gradients, from ``before`` to ``x``, of each vertex' elements; write to ``sums`` (n, 9)."""
    for i in range(len(sums)):
        clear_part(sums[i], 0, 9)
    for e in range(len(shape.cells)):
        f0 = mean_gradient(before, shape, e)
        f, c = mean_gradient(x, shape, e), cofactor(f0)
        j = determinant(f0, c)
        if not j > 0.0:
            continue
        # F F0^-1 = F cof(F0)^T / J0
        p, q, s = times(c, (f[0], f[1], f[2])), times(c, (f[3], f[4], f[5])), times(c, (f[6], f[7], f[8]))
        for a in range(shape.cells.shape[1]):
            total = sums[shape.cells[e, a]]
            for i in range(3):
                total[i] += p[i] / j
                total[3 + i] += q[i] / j
                total[6 + i] += s[i] / j


@internal
def share_sum(sums):
    """Replace the rows of ``sums`` (n, 9) by their sum."""
    for i in range(9):
        total = 0.0
        for k in range(len(sums)):
            total += sums[k, i]
        for k in range(len(sums)):
            sums[k, i] = total


def make_unrotated(count: int) -> Array:
    """Return the rotations (f, 9) of ``count`` vertices that have not rotated: identities."""
    return np.tile(np.eye(3).ravel(), (count, 1))


@kernel
def apply_left_jacobian(turns, vectors):
    """Return J_l(w) u (k, 3) for ``vectors`` u (k, 3) and ``turns`` w (k, 3) [rad], or one rotation vector w (1, 3)."""
    found = np.empty_like(vectors)
    for k in range(len(vectors)):
        against = scale_vector(corner(turns, k if len(turns) > 1 else 0), -1.0)
        found[k, 0], found[k, 1], found[k, 2] = left_jacobian_transposed(against, corner(vectors, k))
    return found

# SPDX-License-Identifier: Apache-2.0
"""Rotation vectors, compiled: Rodrigues' formula and the left Jacobian of the exponential map of SO(3).

For a rotation vector theta of length t, with the cross-product matrix [theta], exp([theta]) = I + a [theta] +
b [theta]^2 and J_l(theta) = I + b [theta] + c [theta]^2. Here a = sin t / t, b = (1 - cos t) / t^2 and
c = (t - sin t) / t^3. Then d exp([theta]) v = -[exp([theta]) v] J_l(theta) d theta (Chirikjian 2012).
"""

from __future__ import annotations

import math

from gdfe_ros.compiled import inlined

SMALL = 1e-4
"""Up to this angle [rad], two terms of the coefficients' series are exact to double precision."""


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
def rotated(r, x, y, z):
    """Return the vector (x, y, z) rotated by the rotation matrix ``r``."""
    return r[0] * x + r[1] * y + r[2] * z, r[3] * x + r[4] * y + r[5] * z, r[6] * x + r[7] * y + r[8] * z


@inlined
def left_jacobian_transposed(turn, moment):
    """Return J_l(theta)^T m: dE/d(rotation vector) if m is the moment of the forces dE/dx."""
    _, b, c = coefficients(turn)
    x, y, z = turn
    m0, m1, m2 = moment
    k0, k1, k2 = y * m2 - z * m1, z * m0 - x * m2, x * m1 - y * m0
    l0, l1, l2 = y * k2 - z * k1, z * k0 - x * k2, x * k1 - y * k0
    return m0 - b * k0 + c * l0, m1 - b * k1 + c * l1, m2 - b * k2 + c * l2

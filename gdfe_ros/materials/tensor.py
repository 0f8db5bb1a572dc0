# SPDX-License-Identifier: Apache-2.0
"""Compiled operations on 3 x 3 matrices, such as the polar decomposition.

A matrix is a tuple of nine floats, row by row.
"""

from __future__ import annotations

import math

from gdfe_ros.compiled import inlined
from gdfe_ros.mesh.triples import cross, dot

NEWTON_STEPS = 40
"""Limit of Newton steps for the sum of the stretches; three to five steps are usual."""
DEGENERATE = 1e-9
"""Lower limit of the denominator of the rotation, divided by I^(3/2). It applies if two signed stretches nearly cancel,
and the rotation is not unique.
"""
SMALLEST = 1e-30
"""Lower limit of the denominator of the rotation, so that the rotation of a collapsed element (F = 0) is finite."""


@inlined
def cofactor(f):
    """Return cof F = J F^-T, the derivative of det F."""
    return (
        f[4] * f[8] - f[5] * f[7],
        f[5] * f[6] - f[3] * f[8],
        f[3] * f[7] - f[4] * f[6],
        f[2] * f[7] - f[1] * f[8],
        f[0] * f[8] - f[2] * f[6],
        f[1] * f[6] - f[0] * f[7],
        f[1] * f[5] - f[2] * f[4],
        f[2] * f[3] - f[0] * f[5],
        f[0] * f[4] - f[1] * f[3],
    )


@inlined
def determinant(f, c):
    """Return J = det F from F and its cofactor ``c``."""
    return f[0] * c[0] + f[1] * c[1] + f[2] * c[2]


@inlined
def squared_norm(f):
    """Return the squared Frobenius norm of a matrix."""
    return (
        f[0] * f[0] + f[1] * f[1] + f[2] * f[2]
        + f[3] * f[3] + f[4] * f[4] + f[5] * f[5]
        + f[6] * f[6] + f[7] * f[7] + f[8] * f[8]
    )  # fmt: skip


@inlined
def stretch_sum(first, second, jacobian):
    """Return s = tr(R^T F), the sum of the signed principal stretches.

    s is the largest root of s^4 - 2 I s^2 - 8 J s + I^2 - 4 II with I = |F|^2 (``first``), II = |cof F|^2 (``second``)
    and J = det F. This is the characteristic polynomial of the polar problem in quaternions (Higham and Noferini 2016).
    The polynomial is convex to the right of its largest root, so Newton's method from the upper bound sqrt(3 I)
    descends to the root.
    """
    s, going = math.sqrt(3.0 * first), True
    for _ in range(NEWTON_STEPS):
        s, going = stretch_sum_step(s, first, second, jacobian)
        if not going:
            break
    return s


@inlined
def stretch_sum_step(s, first, second, jacobian):
    """Return s of `stretch_sum` after one Newton step, and whether another step is needed."""
    square = s * s
    value = (square - 2.0 * first) * square - 8.0 * jacobian * s + (first * first - 4.0 * second)
    slope = 4.0 * (s * (square - first) - 2.0 * jacobian)
    step = value / slope
    following = s - step if slope > 0.0 else s
    return following, (slope > 0.0) & (step > 1e-15 * following)


@inlined
def rotation_from_stretch_sum(f, c, first, s, jacobian):
    """Return the rotation R = ds/dF of the polar decomposition with signed stretches, and a measure of its uniqueness.

    R has the determinant +1. R = ((s^2 + I) F + 2 s cof F - 2 F F^T F) / (s^3 - I s - 2 J), where I = |F|^2 is
    ``first``. The denominator is (l1 + l2)(l2 + l3)(l3 + l1). It vanishes if two signed stretches cancel, and then the
    rotation is not unique. The measure is the denominator divided by I^(3/2).
    """
    denominator = s * (s * s - first) - 2.0 * jacobian
    scale = first * math.sqrt(first) + 1e-300
    margin = denominator / scale
    safe = max(denominator, DEGENERATE * scale, SMALLEST)
    b00 = f[0] * f[0] + f[1] * f[1] + f[2] * f[2]
    b01 = f[0] * f[3] + f[1] * f[4] + f[2] * f[5]
    b02 = f[0] * f[6] + f[1] * f[7] + f[2] * f[8]
    b11 = f[3] * f[3] + f[4] * f[4] + f[5] * f[5]
    b12 = f[3] * f[6] + f[4] * f[7] + f[5] * f[8]
    b22 = f[6] * f[6] + f[7] * f[7] + f[8] * f[8]
    own, other, cubic = (s * s + first) / safe, 2.0 * s / safe, -2.0 / safe
    r = (
        own * f[0] + other * c[0] + cubic * (b00 * f[0] + b01 * f[3] + b02 * f[6]),
        own * f[1] + other * c[1] + cubic * (b00 * f[1] + b01 * f[4] + b02 * f[7]),
        own * f[2] + other * c[2] + cubic * (b00 * f[2] + b01 * f[5] + b02 * f[8]),
        own * f[3] + other * c[3] + cubic * (b01 * f[0] + b11 * f[3] + b12 * f[6]),
        own * f[4] + other * c[4] + cubic * (b01 * f[1] + b11 * f[4] + b12 * f[7]),
        own * f[5] + other * c[5] + cubic * (b01 * f[2] + b11 * f[5] + b12 * f[8]),
        own * f[6] + other * c[6] + cubic * (b02 * f[0] + b12 * f[3] + b22 * f[6]),
        own * f[7] + other * c[7] + cubic * (b02 * f[1] + b12 * f[4] + b22 * f[7]),
        own * f[8] + other * c[8] + cubic * (b02 * f[2] + b12 * f[5] + b22 * f[8]),
    )
    return r, margin


@inlined
def rotation(f):
    """Return the rotation of F, the measure of its uniqueness (see `rotation_from_stretch_sum`), and det F."""
    c = cofactor(f)
    j = determinant(f, c)
    first = squared_norm(f)
    s = stretch_sum(first, squared_norm(c), j)
    r, margin = rotation_from_stretch_sum(f, c, first, s, j)
    return r, margin, j


@inlined
def off_diagonal(a):
    """Return whether a symmetric matrix (00, 01, 02, 11, 12, 22) has significant off-diagonal entries."""
    off = a[1] * a[1] + a[2] * a[2] + a[4] * a[4]
    return off > 1e-32 * (a[0] * a[0] + a[3] * a[3] + a[5] * a[5])


@inlined
def jacobi_sweep(a, v):
    """Apply three Jacobi rotations to a symmetric matrix (00, 01, 02, 11, 12, 22) and its eigenvectors; return both.

    The eigenvectors are the columns of a matrix of nine floats. Nothing is rotated if `off_diagonal` is false: a matrix
    that has converged stays constant, while other matrices of the same SIMD block need further sweeps.
    """
    a00, a01, a02, a11, a12, a22 = a
    v00, v01, v02, v10, v11, v12, v20, v21, v22 = v
    going = off_diagonal(a)
    c, s, t = _jacobi(a00, a11, a01, going)
    a00, a11, a01, a02, a12 = a00 - t * a01, a11 + t * a01, 0.0, c * a02 - s * a12, s * a02 + c * a12
    v00, v01, v10, v11, v20, v21 = (
        c * v00 - s * v01, s * v00 + c * v01, c * v10 - s * v11, s * v10 + c * v11,
        c * v20 - s * v21, s * v20 + c * v21,
    )  # fmt: skip
    c, s, t = _jacobi(a00, a22, a02, going)
    a00, a22, a02, a01, a12 = a00 - t * a02, a22 + t * a02, 0.0, c * a01 - s * a12, s * a01 + c * a12
    v00, v02, v10, v12, v20, v22 = (
        c * v00 - s * v02, s * v00 + c * v02, c * v10 - s * v12, s * v10 + c * v12,
        c * v20 - s * v22, s * v20 + c * v22,
    )  # fmt: skip
    c, s, t = _jacobi(a11, a22, a12, going)
    a11, a22, a12, a01, a02 = a11 - t * a12, a22 + t * a12, 0.0, c * a01 - s * a02, s * a01 + c * a02
    v01, v02, v11, v12, v21, v22 = (
        c * v01 - s * v02, s * v01 + c * v02, c * v11 - s * v12, s * v11 + c * v12,
        c * v21 - s * v22, s * v21 + c * v22,
    )  # fmt: skip
    return (a00, a01, a02, a11, a12, a22), (v00, v01, v02, v10, v11, v12, v20, v21, v22)


@inlined
def _jacobi(app, aqq, apq, going):
    """Return cosine, sine and tangent of the Jacobi rotation that zeroes the entry apq (Golub and Van Loan).

    If ``going`` is false or apq is zero, nothing rotates: they are 1, 0 and 0.
    """
    theta = (aqq - app) / (2.0 * apq)
    t = math.copysign(1.0, theta) / (abs(theta) + math.sqrt(1.0 + theta * theta))
    c = 1.0 / math.sqrt(1.0 + t * t)
    turns = going & (apq != 0.0)
    return (c if turns else 1.0), (t * c if turns else 0.0), (t if turns else 0.0)


@inlined
def times(f, v):
    """Return the product F v of a matrix and a vector."""
    return (
        f[0] * v[0] + f[1] * v[1] + f[2] * v[2],
        f[3] * v[0] + f[4] * v[1] + f[5] * v[2],
        f[6] * v[0] + f[7] * v[1] + f[8] * v[2],
    )


@inlined
def scale_vector(a, factor):
    """Return the vector a, multiplied by ``factor``."""
    return factor * a[0], factor * a[1], factor * a[2]


@inlined
def perpendicular(a):
    """Return a unit vector normal to a unit vector a."""
    b = cross(a, (1.0, 0.0, 0.0)) if abs(a[0]) < 0.7 else cross(a, (0.0, 1.0, 0.0))
    return scale_vector(b, 1.0 / math.sqrt(dot(b, b) + 1e-300))

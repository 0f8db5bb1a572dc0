# SPDX-License-Identifier: Apache-2.0
"""Compiled search for the place of a point in a deformed cell."""

from __future__ import annotations

from gdfe_ros.compiled import inlined, internal

MOST_STEPS = 25
"""Largest number of Newton iterations in one cell."""
EXACT = 1e-9
"""A point counts as inside a cell if its cell coordinates exceed the limits 0 and 1 by less than this."""


@inlined
def corner_shape(which, u, v, w):
    """Return a corner's shape function (VTK's order) at u, v, w in [0, 1], and its three derivatives."""
    a = u if which in (1, 2, 5, 6) else 1.0 - u
    b = v if which in (2, 3, 6, 7) else 1.0 - v
    c = w if which >= 4 else 1.0 - w
    da = 1.0 if which in (1, 2, 5, 6) else -1.0
    db = 1.0 if which in (2, 3, 6, 7) else -1.0
    dc = 1.0 if which >= 4 else -1.0
    return a * b * c, da * b * c, a * db * c, a * b * dc


@internal
def place_in_cell(x, cells, e, px, py, pz):
    """Return whether the point p [m] lies in cell ``e``, and its cell coordinates (3), by Newton's method."""
    u, v, w = 0.5, 0.5, 0.5
    for _ in range(MOST_STEPS):
        r0, r1, r2 = px, py, pz
        a00, a01, a02, a10, a11, a12, a20, a21, a22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for a in range(8):
            q = cells[e, a]
            s, du, dv, dw = corner_shape(a, u, v, w)
            r0, r1, r2 = r0 - s * x[q, 0], r1 - s * x[q, 1], r2 - s * x[q, 2]
            a00, a01, a02 = a00 + du * x[q, 0], a01 + dv * x[q, 0], a02 + dw * x[q, 0]
            a10, a11, a12 = a10 + du * x[q, 1], a11 + dv * x[q, 1], a12 + dw * x[q, 1]
            a20, a21, a22 = a20 + du * x[q, 2], a21 + dv * x[q, 2], a22 + dw * x[q, 2]
        c0, c1, c2 = a11 * a22 - a12 * a21, a12 * a20 - a10 * a22, a10 * a21 - a11 * a20
        det = a00 * c0 + a01 * c1 + a02 * c2
        if det == 0.0:
            break
        d0, d1 = a02 * a21 - a01 * a22, a00 * a22 - a02 * a20
        e0, e1 = a01 * a12 - a02 * a11, a02 * a10 - a00 * a12
        d2, e2 = a01 * a20 - a00 * a21, a00 * a11 - a01 * a10
        u1 = (c0 * r0 + d0 * r1 + e0 * r2) / det
        v1 = (c1 * r0 + d1 * r1 + e1 * r2) / det
        w1 = (c2 * r0 + d2 * r1 + e2 * r2) / det
        u, v, w = clamp(u + u1), clamp(v + v1), clamp(w + w1)
        if abs(u1) + abs(v1) + abs(w1) < 0.1 * EXACT:
            return min(u, v, w) > -EXACT and max(u, v, w) < 1.0 + EXACT, (u, v, w)
    return False, (u, v, w)


@inlined
def clamp(value):
    """Return a cell coordinate clamped to [-0.5, 1.5]."""
    return min(max(value, -0.5), 1.5)

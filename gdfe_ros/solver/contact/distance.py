# SPDX-License-Identifier: Apache-2.0
"""Compiled signed distances to the shapes of obstacles, in the obstacle's frame."""

from __future__ import annotations

import math

from gdfe_ros.compiled import inlined

PLANE, SPHERE, BOX, CAPSULE, CYLINDER, MESH = range(6)
"""Kinds of shapes: the values of ``kind`` in `gdfe_ros.constraints.form`. Distances to a mesh are in `grid.py`."""


@inlined
def signed_distance(kind, a, b, c, x, y, z):
    """Return the signed distance [m] from a point to a shape, negative inside, and its gradient (3,).

    ``a``, ``b`` and ``c`` [m] are the shape's ``numbers`` (see `Form`). At a centre, or on a medial plane, the gradient
    is not unique. The function then returns one of its limits.
    """
    if kind == PLANE:
        return z, 0.0, 0.0, 1.0
    if kind == BOX:
        return box_distance(a, b, c, x, y, z)
    if kind in (SPHERE, CAPSULE):
        z -= min(max(z, -b), b)
        length = math.sqrt(x * x + y * y + z * z)
        if length == 0.0:
            return -a, 1.0, 0.0, 0.0
        return length - a, x / length, y / length, z / length
    rho = math.sqrt(x * x + y * y)
    nx, ny = (x / rho, y / rho) if rho > 0.0 else (1.0, 0.0)
    phi, nr, _, nz = box_distance(a, math.inf, b, rho, 0.0, z)
    return phi, nr * nx, nr * ny, nz


@inlined
def box_distance(a, b, c, x, y, z):
    """Return the signed distance [m] to a box with half edges ``a``, ``b``, ``c`` [m], and its gradient (3,)."""
    sx, sy, sz = math.copysign(1.0, x), math.copysign(1.0, y), math.copysign(1.0, z)
    dx, dy, dz = abs(x) - a, abs(y) - b, abs(z) - c
    if dx <= 0.0 and dy <= 0.0 and dz <= 0.0:
        if dx >= dy and dx >= dz:
            return dx, sx, 0.0, 0.0
        if dy >= dz:
            return dy, 0.0, sy, 0.0
        return dz, 0.0, 0.0, sz
    ox, oy, oz = max(dx, 0.0), max(dy, 0.0), max(dz, 0.0)
    length = math.sqrt(ox * ox + oy * oy + oz * oz)
    return length, sx * ox / length, sy * oy / length, sz * oz / length

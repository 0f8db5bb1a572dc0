# SPDX-License-Identifier: Apache-2.0
"""Compiled energy and vertex forces of cables, chambers and dead loads.

A cable of length L pulls with t = max(0, T + k (L - l)) and has the energy (t^2 - T^2) / (2 k), which is the augmented
Lagrangian of L <= l with multiplier T, and for T = 0 an elastic cable of stiffness k. With k = 0 it is T (L - l). A
chamber of volume V has the energy -p (V - v) + k/2 (V - v)^2: with k = 0 a given pressure, else the augmented
Lagrangian of V = v. Sums run in a fixed order.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import inlined, kernel

EFFORT, TARGET, STIFFNESS, LIMIT, WIDTH = range(5)
"""Columns of ``External.cable`` and ``External.chamber``: T or p, l or v, k, and the volume beyond which a chamber
counts as unstable."""


class External(NamedTuple):
    """Everything that acts on the body from outside; empty arrays where there is nothing.

    Attributes:
        dead: (n, 3) dead forces [N], or (0, 3).
        rest: (n, 3) where their energy is zero [m], or (0, 3).
        cable_start: (c + 1,) int32, where the points of each cable start.
        corners: (p, 8) int32 vertices around each cable point.
        weights: (p, 8) their weights.
        cable: (c, WIDTH) columns named above [N, m, N/m].
        quad_start: (k + 1,) int32, where the quads of each chamber start.
        quads: (q, 4) int32 vertices, normals out of the chamber.
        chamber: (k, WIDTH) columns named above [Pa, m^3, Pa/m^3, m^3].
    """

    dead: NDArray[np.float64]
    rest: NDArray[np.float64]
    cable_start: NDArray[np.int32]
    corners: NDArray[np.int32]
    weights: NDArray[np.float64]
    cable: NDArray[np.float64]
    quad_start: NDArray[np.int32]
    quads: NDArray[np.int32]
    chamber: NDArray[np.float64]

    @property
    def active(self) -> bool:
        """Tell whether anything acts."""
        return len(self.dead) + len(self.cable) + len(self.chamber) > 0


def nothing() -> External:
    """Return what acts on a body that nothing acts on."""
    points, ids, starts = np.zeros((0, 3)), np.zeros((0, 8), np.int32), np.zeros(1, np.int32)
    table = np.zeros((0, WIDTH))
    return External(
        points, points, starts, ids, np.zeros((0, 8)), table, starts, np.zeros((0, 4), np.int32), table.copy()
    )


@kernel
def external_energy(x, external, force):
    """Write dE/dx (n, 3) [N] of all that acts at positions ``x`` (n, 3) [m]; return the energy and its terms' size.

    The energy is infinite where a chamber exceeds its limit. The size bounds the rounding error of the energy [J].
    """
    force[...] = 0.0
    energy, size = 0.0, 0.0
    for v in range(len(external.dead)):
        for axis in range(3):
            work = external.dead[v, axis] * (x[v, axis] - external.rest[v, axis])
            energy -= work
            size += abs(work)
            force[v, axis] -= external.dead[v, axis]
    for c in range(len(external.cable)):
        length = cable_length(x, external, c)
        effort, target, stiffness = external.cable[c, EFFORT], external.cable[c, TARGET], external.cable[c, STIFFNESS]
        tension = cable_tension(length, external.cable[c])
        if stiffness > 0.0:
            energy += (tension * tension - effort * effort) / (2.0 * stiffness)
        else:
            energy += effort * (length - target)
        size += tension * length
        if tension > 0.0:
            pull(x, external, c, tension, force)
    for k in range(len(external.chamber)):
        volume = chamber_volume(x, external, k)
        change, stiffness = volume - external.chamber[k, TARGET], external.chamber[k, STIFFNESS]
        if not abs(volume) <= external.chamber[k, LIMIT]:
            return np.inf, size
        energy += change * (0.5 * stiffness * change - external.chamber[k, EFFORT])
        pressure = chamber_pressure(volume, external.chamber[k])
        size += abs(pressure * volume)
        if pressure != 0.0:
            push(x, external, k, pressure, force)
    return energy, size


@kernel
def cable_tension(length, row):
    """Return the tension [N] of a cable of this length [m]; ``row`` is its row of ``External.cable``."""
    return max(0.0, row[EFFORT] + row[STIFFNESS] * (length - row[TARGET]))


@kernel
def chamber_pressure(volume, row):
    """Return the pressure [Pa] of a chamber of this volume [m^3]; ``row`` is its row of ``External.chamber``."""
    return row[EFFORT] - row[STIFFNESS] * (volume - row[TARGET])


@inlined
def point(x, external, i):
    """Return the position of a cable point [m]."""
    p0, p1, p2 = 0.0, 0.0, 0.0
    for a in range(8):
        v, w = external.corners[i, a], external.weights[i, a]
        p0 += w * x[v, 0]
        p1 += w * x[v, 1]
        p2 += w * x[v, 2]
    return p0, p1, p2


@kernel
def cable_length(x, external, c):
    """Return the length [m] of a cable."""
    total = 0.0
    for i in range(external.cable_start[c], external.cable_start[c + 1] - 1):
        a, b = point(x, external, i), point(x, external, i + 1)
        total += np.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2)
    return total


@kernel
def pull(x, external, c, tension, force):
    """Add tension times dL/dx to ``force`` (n, 3)."""
    for i in range(external.cable_start[c], external.cable_start[c + 1] - 1):
        a, b = point(x, external, i), point(x, external, i + 1)
        d0, d1, d2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        length = np.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
        scale = tension / length if length > 0.0 else 0.0
        for corner in range(8):
            near, far = external.corners[i, corner], external.corners[i + 1, corner]
            w, u = scale * external.weights[i, corner], scale * external.weights[i + 1, corner]
            force[near, 0] -= w * d0
            force[near, 1] -= w * d1
            force[near, 2] -= w * d2
            force[far, 0] += u * d0
            force[far, 1] += u * d1
            force[far, 2] += u * d2


@inlined
def minus(x, a, origin):
    """Return vertex ``a`` relative to ``origin`` [m]."""
    return x[a, 0] - origin[0], x[a, 1] - origin[1], x[a, 2] - origin[2]


@inlined
def cross(a, b):
    """Return a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inlined
def corners_of(x, external, q, origin):
    """Return the four corners of a quad relative to ``origin``."""
    quad = external.quads[q]
    return minus(x, quad[0], origin), minus(x, quad[1], origin), minus(x, quad[2], origin), minus(x, quad[3], origin)


@inlined
def origin_of(x, external, k):
    """Return a vertex of the chamber: volumes are taken relative to it, lest digits be lost far from the origin."""
    v = external.quads[external.quad_start[k], 0]
    return x[v, 0], x[v, 1], x[v, 2]


@kernel
def chamber_volume(x, external, k):
    """Return the volume [m^3] of a chamber of bilinear quads, exact: the mean over both diagonals of each."""
    total = 0.0
    origin = origin_of(x, external, k)
    for q in range(external.quad_start[k], external.quad_start[k + 1]):
        a, b, c, d = corners_of(x, external, q, origin)
        bc, cd, bd = cross(b, c), cross(c, d), cross(b, d)
        total += a[0] * (bc[0] + cd[0] + bd[0]) + a[1] * (bc[1] + cd[1] + bd[1]) + a[2] * (bc[2] + cd[2] + bd[2])
        total += b[0] * cd[0] + b[1] * cd[1] + b[2] * cd[2]
    return total / 12.0


@kernel
def push(x, external, k, pressure, force):
    """Subtract pressure times dV/dx from ``force`` (n, 3)."""
    scale = pressure / 12.0
    origin = origin_of(x, external, k)
    for q in range(external.quad_start[k], external.quad_start[k + 1]):
        a, b, c, d = corners_of(x, external, q, origin)
        ab, ac, ad = cross(a, b), cross(a, c), cross(a, d)
        bc, bd, cd = cross(b, c), cross(b, d), cross(c, d)
        for i in range(3):
            force[external.quads[q, 0], i] -= scale * (bc[i] + cd[i] + bd[i])
            force[external.quads[q, 1], i] -= scale * (cd[i] - ac[i] - ad[i])
            force[external.quads[q, 2], i] -= scale * (ab[i] - ad[i] - bd[i])
            force[external.quads[q, 3], i] -= scale * (ac[i] + ab[i] + bc[i])

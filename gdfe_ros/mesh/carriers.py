# SPDX-License-Identifier: Apache-2.0
"""Compiled search for the cell that carries each of many points."""

from __future__ import annotations

import math

import numpy as np

from gdfe_ros.compiled import inlined, kernel

FARTHEST = 4.0
"""Limit of the magnitude of reference coordinates in Newton's method."""


@inlined
def clipped(value, limit):
    """Return the value, limited to -``limit`` .. ``limit``."""
    return min(max(value, -limit), limit)


@inlined
def solved(a, b, c, gap):
    """Return the solution of the 3 x 3 system with the columns a, b, c and the right-hand side gap (Cramer's rule)."""
    n0, n1, n2 = b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]
    m0, m1, m2 = gap[1] * c[2] - gap[2] * c[1], gap[2] * c[0] - gap[0] * c[2], gap[0] * c[1] - gap[1] * c[0]
    k0, k1, k2 = b[1] * gap[2] - b[2] * gap[1], b[2] * gap[0] - b[0] * gap[2], b[0] * gap[1] - b[1] * gap[0]
    determinant = a[0] * n0 + a[1] * n1 + a[2] * n2
    return (
        (gap[0] * n0 + gap[1] * n1 + gap[2] * n2) / determinant,
        (a[0] * m0 + a[1] * m1 + a[2] * m2) / determinant,
        (a[0] * k0 + a[1] * k1 + a[2] * k2) / determinant,
    )


@inlined
def newton_step(place, point, modes):
    """Return the next Newton iterate of a point's reference coordinates in a cell.

    ``modes`` (8, 3) [m] are the coefficients of the cell's trilinear map, as in `find_carriers`.
    """
    x, y, z = place
    gap, a, b, c = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for i in range(3):
        one, mx, my, mz = modes[0, i], modes[1, i], modes[2, i], modes[3, i]
        yz, xz, xy, xyz = modes[4, i], modes[5, i], modes[6, i], modes[7, i]
        gap[i] = point[i] - (one + mx * x + my * y + mz * z + yz * y * z + xz * x * z + xy * x * y + xyz * x * y * z)
        a[i] = mx + xz * z + xy * y + xyz * y * z
        b[i] = my + yz * z + xy * x + xyz * x * z
        c[i] = mz + yz * y + xz * x + xyz * x * y
    dx, dy, dz = solved(a, b, c, gap)
    return (
        clipped(x + clipped(dx, 1.0), FARTHEST),
        clipped(y + clipped(dy, 1.0), FARTHEST),
        clipped(z + clipped(dz, 1.0), FARTHEST),
    )


@kernel
def find_carriers(points, near, modes, settings, best, place, beyond):
    """Write the cell that carries each point, and the reference coordinates of the point in this cell.

    The cell is the candidate that contains the point, or else the nearest candidate. A candidate is nearer if the
    largest magnitude of the point's reference coordinates in it is smaller. If candidates are equally near, as at a
    common face, the cell with the lowest index carries the point. Newton's method finds the reference coordinates,
    starting from the candidate's centre.

    Args:
        points: (k, 3) [m].
        near: (k, c) indices of the candidate cells of each point, the most likely cell first.
        modes: (m, 8, 3) [m] coefficients of the cells' trilinear maps for 1, xi, eta, zeta, eta zeta, xi zeta, xi eta,
            xi eta zeta.
        settings: three numbers: limit of Newton steps; change of a reference coordinate below which they end; magnitude
            of the reference coordinates below which a point is certainly inside.
        best: (k,) cell of each point, output.
        place: (k, 3) reference coordinates of each point in its cell, output.
        beyond: (k,) largest magnitude of each point's reference coordinates, output.
    """
    steps, within, inside = settings
    for k in range(len(points)):
        best[k], beyond[k] = near[k, 0], math.inf
        for candidate in near[k]:
            here = (0.0, 0.0, 0.0)
            for _ in range(steps):
                last = here
                here = newton_step(last, points[k], modes[candidate])
                change = max(abs(here[0] - last[0]), abs(here[1] - last[1]), abs(here[2] - last[2]))
                if not change > within:
                    break
            away = max(abs(here[0]), abs(here[1]), abs(here[2]))
            alike = abs(away - beyond[k]) <= 1.0 - inside  # equal up to rounding, as on a common face
            if (alike and candidate < best[k]) or (not alike and away < beyond[k]):
                best[k], beyond[k] = candidate, away
                place[k, 0], place[k, 1], place[k, 2] = here
            if beyond[k] < inside:
                break

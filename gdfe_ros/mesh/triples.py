# SPDX-License-Identifier: Apache-2.0
"""Compiled algebra of vectors that are tuples (x, y, z)."""

from __future__ import annotations

import math

from gdfe_ros.compiled import inlined


@inlined
def dot(a, b):
    """Return the inner product of two triples."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def plus(a, b):
    """Return the sum of two triples."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inlined
def minus(a, b):
    """Return the difference of two triples."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inlined
def cross(a, b):
    """Return the vector product of two triples."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inlined
def corner(points, k):
    """Return point ``k`` of an array (n, 3) as a triple."""
    return points[k, 0], points[k, 1], points[k, 2]


@inlined
def along(a, d, b, e):
    """Return a d + b e for the triples d, e and the factors a, b."""
    return a * d[0] + b * e[0], a * d[1] + b * e[1], a * d[2] + b * e[2]


@inlined
def combine(a, u, b, v, c, w):
    """Return a u + b v + c w for the triples u, v, w and the factors a, b, c."""
    return a * u[0] + b * v[0] + c * w[0], a * u[1] + b * v[1] + c * w[1], a * u[2] + b * v[2] + c * w[2]


@inlined
def unit(a):
    """Return the unit vector along a triple; zero for zero."""
    length = math.sqrt(dot(a, a))
    return (a[0] / length, a[1] / length, a[2] / length) if length > 0.0 else (0.0, 0.0, 0.0)

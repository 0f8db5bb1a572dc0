# SPDX-License-Identifier: Apache-2.0
"""Compiled volume between faces and a point, with its derivatives, and the integrals of N_a n over the faces.

The volume of the cones from the faces to an apex is V = 1/3 int x . n dA, with x relative to the apex. It is a sum of
triple products u . (v x w) over integration points, with u = sum_a n_a x_a, v = sum_a g_a x_a and w = sum_a h_a x_a.
Here n_a are the shape functions of the faces, and g_a and h_a their two slopes. These sums are exact for bilinear quads
and six-node triangles. With the matrix [w] of the cross product by w, the second derivative of one triple product is

    d2/dx_a dx_b = (g_a n_b - n_a g_b) [w] + (h_a g_b - g_a h_b) [u] + (n_a h_b - h_a n_b) [v] .
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators.load import GAUSS
from gdfe_ros.compiled import inlined, internal, kernel
from gdfe_ros.mesh.cells.tetrahedra import face_slopes, face_weights, triangle_rule
from gdfe_ros.mesh.triples import along, corner, cross, dot, minus, plus
from gdfe_ros.solver.vectors import Array

NODES, COUNT, FACES = range(3)
"""Offsets in ``integers`` of the number of nodes of a face, the number of faces, and the nodes of all faces."""


Products = tuple[Array, Array, Array, Array]
"""The triple products of a face with c nodes: the weights (p, c) of the nodes in u, v and w, and the weight (p,) of
each product in the volume.
"""


def _four() -> Products:
    """Return the products of a bilinear quad at its 2 x 2 Gauss points."""
    signs = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    factors = 1.0 + signs[None] * (GAUSS * signs)[:, None]
    along = [0.25 * signs[:, i] * factors[:, :, 1 - i] for i in (0, 1)]
    return 0.25 * factors.prod(axis=2), *map(np.ascontiguousarray, along), np.full(4, 1.0 / 3.0)


def _six() -> Products:
    """Return the products of a six-node face at its integration points."""
    places, shares = triangle_rule(3)
    slopes = np.ascontiguousarray(np.moveaxis(face_slopes(places), -1, 0))
    return face_weights(places), *slopes, shares / 6.0


PRODUCTS = {4: _four(), 6: _six()}
"""Dict from the number of a face's nodes to its products."""
_N4, _G4, _H4, _S4 = PRODUCTS[4]
_N6, _G6, _H6, _S6 = PRODUCTS[6]


def pack_faces(faces: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return faces (q, c) in the layout of the kernels."""
    return np.concatenate([faces.shape[::-1], faces.ravel()]).astype(np.int32)


@inlined
def combine(x, apex, integers, first, weights, p):
    """Return the sum of the weights ``weights[p]`` times the nodes from ``first`` on, relative to ``apex``."""
    total = 0.0, 0.0, 0.0
    for a in range(weights.shape[1]):
        total = along(1.0, total, weights[p, a], minus(corner(x, integers[first + a]), apex))
    return total


@inlined
def add_faces(x, integers, apex, n, g, h, share, of_volume, of_area, force):
    """Do `face_forces` with the faces' `Products` ``n``, ``g`` and ``h``."""
    total, nodes, pushes = 0.0, n.shape[1], of_volume != 0.0 or of_area != 0.0
    for q in range(integers[COUNT]):
        first = FACES + nodes * q
        for p in range(len(share)):
            u = combine(x, apex, integers, first, n, p)
            v, w = combine(x, apex, integers, first, g, p), combine(x, apex, integers, first, h, p)
            across, over, under = cross(v, w), cross(w, u), cross(u, v)
            total += share[p] * dot(u, across)
            for a in range(nodes if pushes else 0):
                normal = (of_volume + 3.0 * of_area) * share[p] * n[p, a]
                slope, rise = of_volume * share[p] * g[p, a], of_volume * share[p] * h[p, a]
                for i in range(3):
                    force[integers[first + a], i] += normal * across[i] + slope * over[i] + rise * under[i]
    return total


@internal
def add_quads(x, integers, apex, scale, force):
    """Return the volume between quads and ``apex``; add ``scale`` times its derivative to ``force``.

    The volume of a bilinear quad is the mean over both divisions into triangles. This is five times as fast as the
    triple products at Gauss points.
    """
    total, share = 0.0, scale / 12.0
    for q in range(integers[COUNT]):
        first = FACES + 4 * q
        i, j, k, m = integers[first], integers[first + 1], integers[first + 2], integers[first + 3]
        a, b = minus(corner(x, i), apex), minus(corner(x, j), apex)
        c, d = minus(corner(x, k), apex), minus(corner(x, m), apex)
        bc, cd, bd = cross(b, c), cross(c, d), cross(b, d)
        beside = plus(plus(bc, cd), bd)
        total += dot(a, beside) + dot(b, cd)
        if scale != 0.0:
            ab, ac, ad = cross(a, b), cross(a, c), cross(a, d)
            for axis in range(3):
                force[i, axis] += share * beside[axis]
                force[j, axis] += share * (cd[axis] - ac[axis] - ad[axis])
                force[k, axis] += share * (ab[axis] - ad[axis] - bd[axis])
                force[m, axis] += share * (ac[axis] + ab[axis] + bc[axis])
    return total / 12.0


@kernel
def face_forces(x, integers, apex, of_volume, of_area, force):
    """Return the volume V [m^3] between faces and ``apex`` (3,) [m]; add derivatives to ``force`` (n, 3).

    Added are ``of_volume`` times dV/dx, at a constant apex, and ``of_area`` times f_a = int N_a n dA.
    """
    if integers[NODES] == 4 and of_area == 0.0:
        return add_quads(x, integers, apex, of_volume, force)
    if integers[NODES] == 4:
        return add_faces(x, integers, apex, _N4, _G4, _H4, _S4, of_volume, of_area, force)
    return add_faces(x, integers, apex, _N6, _G6, _H6, _S6, of_volume, of_area, force)


@kernel
def volume_curvature(x, integers, apex, products, scale, out):
    """Write ``scale`` times the second derivative of the volume between faces and ``apex`` to ``out`` (k, 3 c, 3 c)."""
    out[...] = 0.0
    nodes, (normal, along_g, along_h, shares) = integers[NODES], products
    for q in range(integers[COUNT]):
        for p in range(len(shares)):
            n, g, h, share, first = normal[p], along_g[p], along_h[p], scale * shares[p], FACES + nodes * q
            u = combine(x, apex, integers, first, normal, p)
            v = combine(x, apex, integers, first, along_g, p)
            w = combine(x, apex, integers, first, along_h, p)
            for a in range(nodes):
                for b in range(nodes):
                    of_w = share * (g[a] * n[b] - n[a] * g[b])
                    of_u = share * (h[a] * g[b] - g[a] * h[b])
                    of_v = share * (n[a] * h[b] - h[a] * n[b])
                    for i in range(3):
                        j, k = (i + 1) % 3, (i + 2) % 3
                        turn = of_w * w[i] + of_u * u[i] + of_v * v[i]
                        out[q, 3 * a + k, 3 * b + j] += turn
                        out[q, 3 * a + j, 3 * b + k] -= turn

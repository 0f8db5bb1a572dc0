# SPDX-License-Identifier: Apache-2.0
"""Second derivative of the volume inside a closed surface.

The volume is a sum of triple products u . (v x w), with u = sum_a n_a x_a, v = sum_a g_a x_a and w = sum_a h_a x_a over
the corners of a face. With [w] the matrix of the cross product w x ., the second derivative of one of them is

    d2/dx_a dx_b = (g_a n_b - n_a g_b) [w] + (h_a g_b - g_a h_b) [u] + (n_a h_b - h_a n_b) [v] .
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.compiled import inlined, kernel
from gdfe_ros.mesh.tetrahedra import face_slopes, face_weights, triangle_rule


class Products(NamedTuple):
    """The triple products of a face with c corners.

    Attributes:
        n, g, h: (p, c) weights of the corners in u, v and w.
        share: (p,) weight of each product in the volume.
    """

    n: NDArray[np.float64]
    g: NDArray[np.float64]
    h: NDArray[np.float64]
    share: NDArray[np.float64]


def _quad() -> Products:
    """Return the products of a quad: the mean over both divisions into two triangles."""
    corners = np.eye(4)[[[0, 0, 0, 1], [1, 2, 1, 2], [2, 3, 3, 3]]]
    return Products(*np.ascontiguousarray(corners), np.full(4, 1.0 / 12.0))


def _six() -> Products:
    """Return the products of a six-node face at its integration points."""
    places, shares = triangle_rule(3)
    slopes = face_slopes(places)
    return Products(
        face_weights(places), np.ascontiguousarray(slopes[..., 0]), np.ascontiguousarray(slopes[..., 1]), shares / 6.0
    )


PRODUCTS = {4: _quad(), 6: _six()}
"""Dict from the number of a face's corners to its products."""


@inlined
def combined(x, origin, face, weights):
    """Return the sum of weights (c,) times the corners of a face relative to the vertex ``origin``."""
    s0, s1, s2 = 0.0, 0.0, 0.0
    for a in range(len(face)):
        s0 += weights[a] * (x[face[a], 0] - x[origin, 0])
        s1 += weights[a] * (x[face[a], 1] - x[origin, 1])
        s2 += weights[a] * (x[face[a], 2] - x[origin, 2])
    return s0, s1, s2


@kernel
def volume_curvature(x, faces, products, scale, out):
    """Write ``scale`` times the second derivative of the volume inside ``faces`` (k, c) to ``out`` (k, 3 c, 3 c)."""
    out[...] = 0.0
    for q in range(len(faces)):
        for p in range(len(products.share)):
            n, g, h, share = products.n[p], products.g[p], products.h[p], scale * products.share[p]
            u = combined(x, faces[0, 0], faces[q], n)
            v = combined(x, faces[0, 0], faces[q], g)
            w = combined(x, faces[0, 0], faces[q], h)
            for a in range(faces.shape[1]):
                for b in range(faces.shape[1]):
                    of_w = share * (g[a] * n[b] - n[a] * g[b])
                    of_u = share * (h[a] * g[b] - g[a] * h[b])
                    of_v = share * (n[a] * h[b] - h[a] * n[b])
                    for i in range(3):
                        j, k = (i + 1) % 3, (i + 2) % 3
                        turn = of_w * w[i] + of_u * u[i] + of_v * v[i]
                        out[q, 3 * a + k, 3 * b + j] += turn
                        out[q, 3 * a + j, 3 * b + k] -= turn

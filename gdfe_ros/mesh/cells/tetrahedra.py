# SPDX-License-Identifier: Apache-2.0
"""Quadratic tetrahedra: node order, shape functions, integration points, six-node faces, inverse of the map.

A cell has four corners and a node on each of its six edges, in VTK's order. With the barycentric coordinates L_0 .. L_3
of a point, the shape functions are N_i = L_i (2 L_i - 1) for the corners and N_ij = 4 L_i L_j for the edges.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh.cells.faces import Faces, boundary_faces

EDGES = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]], dtype=np.int32)
"""The two end corners of each edge; row i is the edge with the node 4 + i."""
FACES = np.array([[1, 2, 3, 5, 9, 8], [0, 3, 2, 7, 9, 6], [0, 1, 3, 4, 8, 7], [0, 2, 1, 6, 5, 4]], dtype=np.int32)
"""Nodes of the faces, counter-clockwise seen from outside: three corners, then the nodes on the edges 01, 12, 20."""
FACETS = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]], dtype=np.int32)
"""The four triangles between the six nodes of a face."""
PARTS = np.array(
    [[0, 4, 6, 7], [4, 1, 5, 8], [6, 5, 2, 9], [7, 8, 9, 3], [4, 9, 5, 6], [4, 9, 6, 7], [4, 9, 7, 8], [4, 9, 8, 5]],
    dtype=np.int32,
)
"""Nodes of the eight tetrahedra with straight edges into which the ten nodes divide a cell, in any orientation."""
SIX = np.array([[0, 1, 2], [1, 2, 0]], dtype=np.int32)
"""The two end corners (2 rows) of each edge of a face; column i is the edge with the node 3 + i."""

_NEAR, _FAR = (5.0 + 3.0 * 5.0**0.5) / 20.0, (5.0 - 5.0**0.5) / 20.0
POINTS = np.full((4, 4), _FAR) + (_NEAR - _FAR) * np.eye(4)
"""Barycentric coordinates (4, 4) of the element's integration points. The weight of each point is a quarter of the
volume. The rule is exact for quadratic polynomials.
"""
CORNER_SLOPES = np.array([[-1.0, -1.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
"""dL_i/dxi_k (4, 3) with xi = (L_1, L_2, L_3)."""
NEWTON_STEPS = 25
"""Largest number of Newton steps for a point's barycentric coordinates; three to five steps are usual."""
SETTLED = 1e-10
"""Newton's method ends when a point's barycentric coordinates change by less than this."""


def quadratic_weights(place: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the values of the shape functions (..., 10) at barycentric coordinates (..., 4)."""
    corners = place * (2.0 * place - 1.0)
    return np.concatenate([corners, 4.0 * place[..., EDGES[:, 0]] * place[..., EDGES[:, 1]]], axis=-1)


def quadratic_slopes(place: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return dN_a/dxi_k (..., 10, 3) at barycentric coordinates (..., 4)."""
    corners = (4.0 * place - 1.0)[..., None] * CORNER_SLOPES
    first, second = place[..., EDGES[:, 0], None], place[..., EDGES[:, 1], None]
    edges = 4.0 * (first * CORNER_SLOPES[EDGES[:, 1]] + second * CORNER_SLOPES[EDGES[:, 0]])
    return np.concatenate([corners, edges], axis=-2)


def barycentric(points: NDArray[np.float64], corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the barycentric coordinates (k, 4) of points (k, 3) or (3,) in cells with nodes (k, 10, 3).

    They are found by Newton's method. In a cell with straight edges the first step is exact. The sum of the coordinates
    is one. The last three are limited to -3 .. 4.
    """
    place = np.full((len(corners), 4), 0.25)
    points = np.broadcast_to(points, (len(corners), 3))
    sought = np.arange(len(corners))
    for _ in range(NEWTON_STEPS):
        last, nodes = place[sought], corners[sought]
        gap = points[sought] - np.einsum("ka,kai->ki", quadratic_weights(last), nodes)
        jacobian = np.einsum("kai,kaj->kij", nodes, quadratic_slopes(last))
        step = np.clip(np.linalg.solve(jacobian, gap[..., None])[..., 0], -1.0, 1.0)
        moved = np.clip(last[:, 1:] + step, -3.0, 4.0)
        place[sought] = np.concatenate([1.0 - moved.sum(axis=1, keepdims=True), moved], axis=1)
        sought = sought[np.abs(step).max(axis=1) > SETTLED]
        if len(sought) == 0:
            break
    return place


def simplex_rule(order: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return an integration rule of a tetrahedron: barycentric points (q, 4), and weights (q,) whose sum is one.

    With ``order`` points along each direction the rule is exact for polynomials of degree 2 order - 1. The points are
    Gauss-Jacobi points on a collapsed cube (Stroud 1971). Their number is not minimal, but all points are inside the
    tetrahedron and all weights are positive.
    """
    from scipy.special import roots_jacobi

    def line(power: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        points, weights = roots_jacobi(order, power, 0.0)
        return 0.5 * (1.0 + points), weights / weights.sum()

    (u, wu), (v, wv), (w, ww) = line(2), line(1), line(0)
    first, second, third = (grid.ravel() for grid in np.meshgrid(u, v, w, indexing="ij"))
    weights = (wu[:, None, None] * wv[None, :, None] * ww[None, None, :]).ravel()
    place = np.stack([first, second * (1.0 - first), third * (1.0 - first) * (1.0 - second)], axis=1)
    return np.concatenate([1.0 - place.sum(axis=1, keepdims=True), place], axis=1), weights


def triangle_rule(order: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return an integration rule of a triangle: barycentric points (q, 3) and weights (q,), as in `simplex_rule`."""
    from scipy.special import roots_jacobi

    (u, wu), (v, wv) = ((0.5 * (1.0 + p), w / w.sum()) for p, w in (roots_jacobi(order, n, 0.0) for n in (1, 0)))
    first, second = (grid.ravel() for grid in np.meshgrid(u, v, indexing="ij"))
    second = second * (1.0 - first)
    return np.stack([1.0 - first - second, first, second], axis=1), (wu[:, None] * wv[None, :]).ravel()


def face_weights(place: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the values of the shape functions (..., 6) of a face's nodes at barycentric coordinates (..., 3)."""
    edges = 4.0 * place[..., SIX[0]] * place[..., SIX[1]]
    return np.concatenate([place * (2.0 * place - 1.0), edges], axis=-1)


def face_slopes(place: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return dN_a/dxi_k (..., 6, 2) of a face's nodes at barycentric coordinates (..., 3), with xi = (L_1, L_2)."""
    own = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    corners = (4.0 * place - 1.0)[..., None] * own
    first, second = place[..., SIX[0], None], place[..., SIX[1], None]
    return np.concatenate([corners, 4.0 * (first * own[SIX[1]] + second * own[SIX[0]])], axis=-2)


def tet_boundary(cells: NDArray[np.int32]) -> Faces:
    """Return the faces (q, 6) that belong to exactly one of the cells (m, 10), in the order of the cells."""
    return boundary_faces(cells, FACES)


def facets(faces: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the four triangles between the nodes of each six-node face (q, 6), as (4 q, 3)."""
    return faces[:, FACETS].reshape(-1, 3)


def flat_quads(faces: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return faces as quads (k, 4).

    Quads (q, 4) are returned unchanged. Triangles (q, 3) become quads whose last two corners are equal. A six-node face
    (q, 6) becomes four triangles.
    """
    if faces.shape[1] == 4:
        return faces
    return (facets(faces) if faces.shape[1] == 6 else faces)[:, [0, 1, 2, 2]]


def node_areas(points: NDArray[np.float64], faces: NDArray[np.int32]) -> NDArray[np.float64]:
    """Return the integrals of the shape functions, int N_a dA (q, 6) [m^2], over six-node faces (q, 6).

    The nodes are at ``points`` (n, 3) [m]. On a flat face with straight edges the integral is zero for the corners, and
    a third of the area for each node on an edge.
    """
    nodes, areas = points[faces], np.zeros(faces.shape)
    for place, weight in zip(*triangle_rule(4), strict=True):
        along = np.einsum("qai,ak->qki", nodes, face_slopes(place))
        size = 0.5 * np.linalg.norm(np.cross(along[:, 0], along[:, 1]), axis=1)
        areas += weight * size[:, None] * face_weights(place)
    return areas


def six_node_volume(points: NDArray[np.float64], faces: NDArray[np.int32]) -> float:
    """Return the volume [m^3] inside a closed surface of six-node faces (q, 6), positive for outward normals."""
    if len(faces) == 0:
        return 0.0
    nodes, total = points[faces] - points[faces[0, 0]], 0.0
    for place, weight in zip(*triangle_rule(3), strict=True):
        at = np.einsum("qai,a->qi", nodes, face_weights(place))
        along = np.einsum("qai,ak->qki", nodes, face_slopes(place))
        total += weight * np.einsum("qi,qi->", at, np.cross(along[:, 0], along[:, 1])) / 6.0
    return float(total)

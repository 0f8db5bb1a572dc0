# SPDX-License-Identifier: Apache-2.0
"""Six-node faces of quadratic tetrahedra."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh.faces import Faces, boundary_faces
from gdfe_ros.mesh.tetrahedra import FACES, FACETS, face_slopes, face_weights, triangle_rule


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

# SPDX-License-Identifier: Apache-2.0
"""Overlap of two meshes of which one or both touch by their skins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh.box_tree import BoxTree
from gdfe_ros.mesh.distance_grid import least_distances
from gdfe_ros.mesh.mesh import Mesh
from gdfe_ros.mesh.ray_hits import first_hits
from gdfe_ros.mesh.tet_faces import flat_quads
from gdfe_ros.mesh.touching import outline

RAYS = np.array([[0.36, 0.48, 0.8], [-0.8, 0.36, 0.48], [0.48, -0.8, -0.36]])
"""Directions of three rays from a point. The point is inside a surface if two rays meet the surface from inside. A
single ray may pass exactly through an edge.
"""
FLAT = 1e-12
"""A triangle counts as flat if its height, divided by the surface's size, is at most this."""


def deepest_point(first: Mesh, second: Mesh) -> tuple[float, NDArray[np.float64]]:
    """Return the largest depth [m] of a point of one mesh's surface inside the other's, and this point (3,) [m].

    The points are contact points of skins and vertices of faces. Two surfaces may cross between them.
    """
    depths, places = [np.zeros(1)], [np.zeros((1, 3))]
    for own, other in ((first, second), (second, first)):
        points, (vertices, quads) = _points_of(own), _surface_of(other)
        within = ((points >= vertices.min(axis=0)) & (points <= vertices.max(axis=0))).all(axis=1)
        triangles = quads[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
        triangles = triangles[triangles[:, 1] != triangles[:, 2]]
        tree = BoxTree.of(vertices, triangles, flat=FLAT * float(np.ptp(vertices, axis=0).max()))
        inner = points[within][_inside(points[within], tree)]
        away = np.empty(len(inner))
        least_distances(inner, tree.corners[tree.normals.any(axis=1)], away)
        depths.append(away)
        places.append(inner)
    depth, place = np.concatenate(depths), np.concatenate(places)
    deepest = int(depth.argmax())
    return float(depth[deepest]), place[deepest]


def _points_of(mesh: Mesh) -> NDArray[np.float64]:
    """Return the points (k, 3) [m] with which a mesh touches."""
    if mesh.touching is not None:
        return mesh.touching.at(mesh.vertices)
    return mesh.vertices[np.unique(mesh.boundary.quads)]


def _surface_of(mesh: Mesh) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Return the surface with which a mesh touches: used points (k, 3) [m], and quads (q, 4) of their indices."""
    points, quads = outline(flat_quads(mesh.boundary.quads), mesh.touching, mesh.vertices)
    used, local = np.unique(quads, return_inverse=True)
    return points[used], local.reshape(quads.shape).astype(np.int32)


def _inside(points: NDArray[np.float64], tree: BoxTree) -> NDArray[np.bool_]:
    """Return whether each of ``points`` (k, 3) [m] is inside a closed surface with normals out of the material."""
    votes = np.zeros(len(points), dtype=np.int64)
    for ray in RAYS:
        lengths, hits = np.empty(len(points)), np.empty(len(points), dtype=np.int64)
        first_hits(points, np.tile(ray, (len(points), 1)), tree.corners, tree.boxes, 0.0, lengths, hits)
        votes += (hits >= 0) & (tree.normals[hits] @ ray > 0.0)
    return votes >= 2

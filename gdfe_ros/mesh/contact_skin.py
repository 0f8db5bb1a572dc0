# SPDX-License-Identifier: Apache-2.0
"""Contact by a skin instead of by the faces of the cells under it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh.cavities import open_edges
from gdfe_ros.mesh.contact_faces import contact_faces
from gdfe_ros.mesh.hexmesh import HexMesh
from gdfe_ros.mesh.shells import inside, shell_numbers, shells
from gdfe_ros.mesh.skin_points import SkinPoints
from gdfe_ros.mesh.touching import Touching
from gdfe_ros.mesh.trilinear import trilinear_weights

BARE, SHORT = 2.0 * 3.0**0.5, 1.0
"""Largest distance from the centroid of a boundary cell's material to the skin, divided by the cell's edge. A cell with
a larger distance counts as not covered. BARE applies to centroids inside the skin, for example at a hole of the body
that is missing in the skin. SHORT applies to centroids outside the skin.
"""


def touch_by_skin(mesh: HexMesh, points: NDArray[np.float64], triangles: NDArray[np.int64]) -> HexMesh:
    """Return a copy of a mesh whose contact points are points of its skin, not vertices of its cells.

    The cells resolve about one contact point for each boundary vertex. It is the skin point in which the vertex has the
    largest weight: on a flat face the nearest skin point, and at an edge of the body a point of the edge.

    Args:
        mesh: the mesh with its skin.
        points: points of the skin's surface before its refinement (k, 3) [m].
        triangles: ids of the points of each triangle (t, 3).

    Raises:
        MeshError: the surface is open, or does not cover some boundary cells.
    """
    _require_closed(points, triangles)
    lined = SkinPoints.of(mesh, points, out_of_material(points, triangles))
    _require_covered(mesh, lined, points, triangles)
    some = lined.touching(mesh)
    corners, weights = np.ascontiguousarray(lined.corners[some], dtype=np.int32), lined.weights[some]
    everything = np.arange(mesh.n_vertices, dtype=np.int32)
    return replace(mesh, touching=Touching(corners, weights, contact_faces(lined, some), everything, mesh.skin))


def is_closed(triangles: NDArray[np.int64]) -> bool:
    """Return whether a surface is closed: each edge occurs equally often in both directions."""
    return len(open_edges(triangles)) == 0


def _require_closed(points: NDArray[np.float64], triangles: NDArray[np.int64]) -> None:
    leaks = open_edges(triangles)
    if len(leaks):
        x, y, z = points[leaks[0]].mean(axis=0)
        text = (
            f"contact needs a closed skin. At {len(leaks)} edges of this skin the second triangle is missing or faces "
            f"the other direction, first at ({x:.4g}, {y:.4g}, {z:.4g}) m; remedy: close the holes "
            "(MeshLab: Close Holes, Blender: 3D-Print toolbox), or set contact: false, then the skin is only drawn"
        )
        raise MeshError("skin", [text])


def out_of_material(points: NDArray[np.float64], triangles: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the triangles (t, 3) of nested shells, oriented so that normals point out of the material."""
    a, b, c = (points[triangles[:, i]] - points.mean(axis=0) for i in range(3))
    number = shell_numbers(len(points), triangles)
    volumes = np.bincount(number, np.einsum("ti,ti->t", a, np.cross(b, c)))
    inwards = (volumes < 0.0) != (np.array(shells(points, triangles).depths) % 2 == 1)
    return np.where(inwards[number, None], triangles[:, ::-1], triangles)


def _require_covered(
    mesh: HexMesh, lined: SkinPoints, points: NDArray[np.float64], triangles: NDArray[np.int64]
) -> None:
    """Raise MeshError if a skin does not cover some boundary cells; obstacles would penetrate these cells."""
    cells = np.unique(mesh.boundary.cells)
    corners = mesh.vertices[mesh.cells[cells]]
    centres = mesh.centroids[cells]
    if mesh.filling is not None:
        centres = np.einsum("ca,cai->ci", trilinear_weights(mesh.filling.centre[cells]), corners)
    edges = np.linalg.norm(corners[:, 6] - corners[:, 0], axis=1) / 3.0**0.5
    away = cKDTree(lined.places).query(centres)[0] / edges
    missed = np.flatnonzero(away > SHORT)
    missed = missed[(away[missed] > BARE) | ~inside(centres[missed], points, triangles)]
    if len(missed):
        worst = missed[np.argmax(away[missed])]
        x, y, z = centres[worst]
        text = (
            f"{len(missed)} cells at the boundary are left outside of the skin, or are far from it, so that contact "
            f"would not see them. The farthest cell, at ({x:.4g}, {y:.4g}, {z:.4g}) m, is "
            f"{away[worst] * edges[worst]:.3g} m away; allowed: the length of its edges, {edges[worst]:.3g} m; "
            "remedy: a skin of the whole body (check scale and place of the file), or contact: false, then the "
            "skin is only drawn"
        )
        raise MeshError("skin", [text])

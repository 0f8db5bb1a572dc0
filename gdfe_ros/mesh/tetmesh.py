# SPDX-License-Identifier: Apache-2.0
"""The mesh of quadratic tetrahedra, and its construction from linear tetrahedra and from hexahedra."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh.cells.faces import HEX_FACES
from gdfe_ros.mesh.cells.tet_operators import corner_jacobians
from gdfe_ros.mesh.cells.tetrahedra import EDGES, FACES, quadratic_slopes, simplex_rule
from gdfe_ros.mesh.mesh import HexMesh, Mesh
from gdfe_ros.mesh.surfaces.surface_edges import number_edges


@dataclass(frozen=True, eq=False, repr=False)
class TetMesh(Mesh):
    """A mesh of 10-node tetrahedra.

    The nodes of ``cells`` (m, 10) are in VTK's order: four corners, then the nodes on the edges 01, 12, 02, 03, 13, 23.
    Seen from the last corner, the first three corners are counter-clockwise. The other attributes are those of `Mesh`.

    Attributes:
        linear: whether the mesh was made from the linear tetrahedra of a file; all edges are then straight.
        hexahedra: number of the hexahedra that were divided into these tetrahedra; 0 if there were none.
    """

    linear: bool = False
    hexahedra: int = 0
    nodes: ClassVar[int] = 10
    noun: ClassVar[str] = "tetrahedra"
    vtk: ClassVar[str] = "tetra10"
    corners: ClassVar[int] = 4
    edges: ClassVar[NDArray[np.int32]] = EDGES
    faces: ClassVar[NDArray[np.int32]] = FACES


def elevate(
    vertices: NDArray[np.float64],
    corners: NDArray[np.integer],
    cell_sets: Mapping[str, NDArray[np.integer]] | None = None,
    vertex_sets: Mapping[str, NDArray[np.integer]] | None = None,
    *,
    linear: bool = False,
) -> TetMesh:
    """Return a quadratic mesh from linear tetrahedra: each edge gets a node in its middle, and corners keep their ids.

    Args:
        vertices: (n, 3) [m].
        corners: (m, 4) vertex ids.
        cell_sets: named cell ids.
        vertex_sets: named vertex ids; a new node joins the sets to which both ends of its edge belong.
        linear: as in `TetMesh`.
    """
    ends = np.sort(corners[:, EDGES].reshape(-1, 2), axis=1)
    edges, number = number_edges(ends)
    middles = len(vertices) + number.reshape(-1, 6)
    sets = {}
    for name, ids in (vertex_sets or {}).items():
        chosen = np.zeros(len(vertices), dtype=bool)
        chosen[ids] = True
        sets[name] = np.concatenate([ids, len(vertices) + np.flatnonzero(chosen[edges].all(axis=1))])
    points = np.concatenate([vertices, vertices[edges].mean(axis=1)])
    return TetMesh(points, np.concatenate([corners, middles], axis=1), cell_sets or {}, sets, linear=linear)


def divide(mesh: HexMesh) -> TetMesh:
    """Divide each hexahedron of a mesh into six quadratic tetrahedra.

    Vertices keep their ids and sets. The skin and the filling of cut cells are dropped.
    """
    cells = {name: (6 * ids[:, None] + np.arange(6)).ravel() for name, ids in mesh.cell_sets.items()}
    return replace(elevate(mesh.vertices, corners_of_six(mesh.cells), cells, mesh.vertex_sets), hexahedra=mesh.n_cells)


def corners_of_six(cells: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the corners (6 m, 4) of six linear tetrahedra for each hexahedron (m, 8).

    Each face is cut by the diagonal from its vertex with the lowest id, so that neighbouring tetrahedra match in any
    mesh. The tetrahedra of a cell join its vertex with the lowest id to the triangles of the three faces without this
    vertex (pulling triangulation).
    """
    faces, lowest = cells[:, HEX_FACES], cells.min(axis=1)
    turn = (faces.argmin(axis=2)[..., None] + np.arange(4)) % 4
    turned = np.take_along_axis(faces, turn, axis=2)
    a, b, c, d = turned[(faces != lowest[:, None, None]).all(axis=2)].T
    triangles = np.stack([np.stack([a, c, b], axis=1), np.stack([a, d, c], axis=1)], axis=1).reshape(-1, 3)
    return np.concatenate([triangles, np.repeat(lowest, 6)[:, None]], axis=1)


def scaled_jacobians(mesh: TetMesh) -> NDArray[np.float64]:
    """Return the least scaled Jacobian over the four corners of each cell, shape (m,).

    At a corner whose edges have the tangent vectors a, b, c it is 2^(1/2) a . (b x c) / (|a| |b| |c|). It is 1 for a
    regular tetrahedron with straight edges, and <= 0 for a flat or inverted corner. At a corner with a tangent vector
    of zero length it is 0.
    """
    jacobian = corner_jacobians(mesh.vertices[mesh.cells])
    first, second, third = np.moveaxis(jacobian, 3, 0)
    volume = np.einsum("mci,mci->mc", first, np.cross(second, third))
    # The directions at corner c are G_j - G_c; the columns are G_j - G_0.
    whole = np.concatenate([np.zeros((*jacobian.shape[:2], 3, 1)), jacobian], axis=3)
    own = np.stack([whole[:, c] - whole[:, c, :, c, None] for c in range(4)], axis=1)
    lengths = np.linalg.norm(own, axis=2)
    lengths[:, np.arange(4), np.arange(4)] = 1.0
    scale = lengths.prod(axis=2)
    return np.divide(2.0**0.5 * volume, scale, out=np.zeros_like(volume), where=scale > 0.0).min(axis=1)


def cell_volumes(mesh: TetMesh) -> NDArray[np.float64]:
    """Return the exact volume of each cell [m^3], shape (m,), negative for an inverted cell."""
    nodes, total = mesh.vertices[mesh.cells], np.zeros(mesh.n_cells)
    for place, weight in zip(*simplex_rule(2), strict=True):
        total += weight / 6.0 * np.linalg.det(np.einsum("eai,aj->eij", nodes, quadratic_slopes(place)))
    return total

# SPDX-License-Identifier: Apache-2.0
"""The mesh of quadratic tetrahedra, and its construction from linear tetrahedra and from hexahedra."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh.faces import Faces
from gdfe_ros.mesh.hexmesh import HexMesh
from gdfe_ros.mesh.mesh import Mesh
from gdfe_ros.mesh.tet_faces import tet_boundary
from gdfe_ros.mesh.tetrahedra import EDGES

SIX_OF_A_HEXAHEDRON = np.array(
    [[0, 1, 2, 6], [0, 5, 1, 6], [0, 2, 3, 6], [0, 4, 5, 6], [0, 3, 7, 6], [0, 7, 4, 6]], dtype=np.int32
)
"""Corners of the six tetrahedra around the diagonal 0-6 of a hexahedron (Kuhn). In a structured grid, the tetrahedra of
neighbouring hexahedra match at the common face."""


@dataclass(frozen=True, eq=False, repr=False)
class TetMesh(Mesh):
    """A mesh of 10-node tetrahedra.

    The nodes of ``cells`` (m, 10) are in VTK's order: four corners, then the nodes on the edges 01, 12, 02, 03, 13, 23.
    Seen from the last corner, the first three corners are counter-clockwise. The other attributes are those of `Mesh`.

    Attributes:
        linear: whether the mesh was made from the linear tetrahedra of a file; all edges are then straight.
    """

    linear: bool = False
    nodes: ClassVar[int] = 10
    noun: ClassVar[str] = "tetrahedra"
    vtk: ClassVar[str] = "tetra10"

    @cached_property
    def centroids(self) -> NDArray[np.float64]:
        """Mean of the four corners of each cell [m], shape (m, 3)."""
        return self.vertices[self.cells[:, :4]].mean(axis=1)

    @cached_property
    def boundary(self) -> Faces:
        """Faces of six nodes that belong to one cell only, oriented out of the material."""
        return tet_boundary(self.cells)


def raised(
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
    edges, number = np.unique(ends, axis=0, return_inverse=True)
    middles = len(vertices) + number.reshape(-1, 6)
    sets = {}
    for name, ids in (vertex_sets or {}).items():
        chosen = np.zeros(len(vertices), dtype=bool)
        chosen[ids] = True
        sets[name] = np.concatenate([ids, len(vertices) + np.flatnonzero(chosen[edges].all(axis=1))])
    points = np.concatenate([vertices, vertices[edges].mean(axis=1)])
    return TetMesh(points, np.concatenate([corners, middles], axis=1), cell_sets or {}, sets, linear=linear)


def divided(mesh: HexMesh) -> TetMesh:
    """Divide each hexahedron of a mesh into six quadratic tetrahedra.

    In a structured grid, the tetrahedra of neighbouring hexahedra match at the common face.
    """
    corners = mesh.cells[:, SIX_OF_A_HEXAHEDRON].reshape(-1, 4)
    cells = {name: (6 * ids[:, None] + np.arange(6)).ravel() for name, ids in mesh.cell_sets.items()}
    return raised(mesh.vertices, corners, cells, mesh.vertex_sets)

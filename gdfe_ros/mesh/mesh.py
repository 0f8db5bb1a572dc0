# SPDX-License-Identifier: Apache-2.0
"""Meshes of hexahedra and their base class: flat arrays in one layout, SI units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh.cells.faces import HEX_EDGES, HEX_FACES, Faces, boundary_faces
from gdfe_ros.mesh.cells.filling import Filling
from gdfe_ros.mesh.outside import Outside
from gdfe_ros.mesh.touching import Touching


@dataclass(frozen=True, eq=False, repr=False)
class Mesh:
    """Base class of `HexMesh` and `TetMesh`: a mesh with cells of one type.

    Attributes:
        vertices: positions [m], shape (n, 3), float64, C-contiguous.
        cells: vertex ids of each cell, shape (m, c), int32, in VTK's order.
        cell_sets: named sorted cell ids, int32 (physical groups, element sets of an imported file).
        vertex_sets: named sorted vertex ids, int32 (node and face sets of an imported file).
        filling: filled fraction of the cells; None if every cell is entirely filled.
        skin: surface that is drawn instead of the cells' outer faces; None if these faces are drawn.
        touching: contact points and triangles on skins: in contact, they replace the faces of cells. None if contact
            acts on faces of cells only.
        parts: dict from name to each mesh from which this mesh was assembled; empty for a single mesh.
        remarks: messages about content of the mesh's file that was left out.

    Arrays are converted to these types and to this layout. Only shapes and integer ids are checked here. `check_mesh`
    checks the content.

    Raises:
        MeshError: `vertices` has another shape than (n, 3), `cells` has another shape than (m, c), or `cells` are not
            integers.
    """

    nodes: ClassVar[int]
    """Number c of nodes of each cell."""
    noun: ClassVar[str]
    """Name of the cells in messages, plural."""
    vtk: ClassVar[str]
    """meshio's name of the cell type."""
    corners: ClassVar[int]
    """Number of corners of each cell; they are its first nodes."""
    edges: ClassVar[NDArray[np.int32]]
    """Local corners (12 or 6, 2) at the ends of the edges of a cell."""
    faces: ClassVar[NDArray[np.int32]]
    """Local nodes (6, 4) or (4, 6) of the faces of a cell, as in `Faces`."""

    vertices: NDArray[np.float64]
    cells: NDArray[np.int32]
    cell_sets: Mapping[str, NDArray[np.int32]] = field(default_factory=dict)
    vertex_sets: Mapping[str, NDArray[np.int32]] = field(default_factory=dict)
    filling: Filling | None = None
    skin: Outside | None = None
    touching: Touching | None = None
    parts: Mapping[str, MeshPart] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        vertices = np.ascontiguousarray(self.vertices, dtype=np.float64)
        cells = np.asarray(self.cells)
        defects = []
        if vertices.ndim != 2 or vertices.shape[1] != 3:
            defects.append(f"vertices have the shape {vertices.shape}; allowed: (n, 3), positions in metres")
        if cells.ndim != 2 or cells.shape[1] != self.nodes:
            allowed = f"(m, {self.nodes}), {self.nodes} vertex ids for each cell ({self.noun})"
            defects.append(f"cells have the shape {cells.shape}; allowed: {allowed}")
        if not np.issubdtype(cells.dtype, np.integer):
            defects.append(f"cells have the type {cells.dtype}; allowed: integers (vertex ids from 0)")
        if defects:
            raise MeshError("the mesh arrays do not fit", defects)
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "cells", np.ascontiguousarray(cells, dtype=np.int32))
        for name in ("cell_sets", "vertex_sets"):
            sets = {key: np.unique(ids).astype(np.int32) for key, ids in getattr(self, name).items()}
            object.__setattr__(self, name, sets)

    def __repr__(self) -> str:
        spans = (
            " x ".join(f"{span:.4g}" for span in self.bounds[1] - self.bounds[0]) if len(self.vertices) else "nothing"
        )
        parts = f", of {', '.join(self.parts)}" if self.parts else ""
        return f"{type(self).__name__}({self.n_cells} cells, {self.n_vertices} vertices, {spans} m{parts})"

    @property
    def n_vertices(self) -> int:
        """Number of vertices."""
        return len(self.vertices)

    @property
    def n_cells(self) -> int:
        """Number of cells."""
        return len(self.cells)

    @cached_property
    def centroids(self) -> NDArray[np.float64]:
        """Mean of the corners of each cell [m], shape (m, 3)."""
        return self.vertices[self.cells[:, : self.corners]].mean(axis=1)

    @cached_property
    def bounds(self) -> NDArray[np.float64]:
        """Lowest and highest corner of the bounding box [m], shape (2, 3)."""
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    @cached_property
    def size(self) -> float:
        """Diagonal of the bounding box [m]; for an assembly, the largest diagonal among its meshes."""
        if self.parts:
            return max(part.mesh.size for part in self.parts.values())
        return self.extent

    @property
    def extent(self) -> float:
        """Diagonal of the bounding box of all vertices [m]; for an assembly it is usually larger than `size`."""
        return float(np.linalg.norm(self.bounds[1] - self.bounds[0]))

    @property
    def edge_lengths(self) -> NDArray[np.float64]:
        """Lengths (m, 12 or 6) [m] of the straight lines between the corners at the ends of each cell's edges."""
        return np.linalg.norm(self.along_edges(self.vertices[self.cells]), axis=2)

    def along_edges(self, corners: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the vectors (k, 12 or 6, 3) along the edges of cells of this type with ``corners`` (k, c, 3) [m]."""
        return corners[:, self.edges[:, 1]] - corners[:, self.edges[:, 0]]

    @cached_property
    def boundary(self) -> Faces:
        """Faces that belong to one cell only, oriented out of the material."""
        return boundary_faces(self.cells, self.faces)

    @cached_property
    def outside(self) -> Outside:
        """Surface that is drawn: the skin or, without a skin, the boundary."""
        return self.skin or Outside.of_faces(self.boundary)

    def surface(self) -> NDArray[np.int32]:
        """Boundary faces, shape (q, 4) or (q, 6), int32, as in `Faces`, normals out of the material."""
        return self.boundary.quads


@dataclass(frozen=True, eq=False)
class MeshPart:
    """One mesh of an assembly, with its pose.

    Attributes:
        mesh: the mesh in its own frame.
        at: origin of the mesh's frame [m], shape (3,).
        rotation: axes of the mesh's frame as columns, shape (3, 3).
        first_vertex: index of the mesh's first vertex in the assembly; its other vertices follow in their order.
        first_cell: index of the mesh's first cell in the assembly.
    """

    mesh: Mesh
    at: NDArray[np.float64]
    rotation: NDArray[np.float64]
    first_vertex: int = 0
    first_cell: int = 0

    def place(self) -> Mesh:
        """Return the mesh in the assembly's frame; if the pose is zero, its coordinates stay bitwise equal."""
        vertices = self.mesh.vertices
        if not np.array_equal(self.rotation, np.eye(3)):
            vertices = vertices @ self.rotation.T
        if self.at.any():
            vertices = vertices + self.at
        return replace(self.mesh, vertices=vertices)


@dataclass(frozen=True, eq=False, repr=False)
class HexMesh(Mesh):
    """A mesh of 8-vertex hexahedra.

    The vertices of ``cells`` (m, 8) are in VTK's order: the four bottom vertices, counter-clockwise seen from the top,
    then the four top vertices, each above its bottom vertex. The other attributes are those of `Mesh`.
    """

    nodes: ClassVar[int] = 8
    noun: ClassVar[str] = "hexahedra"
    vtk: ClassVar[str] = "hexahedron"
    corners: ClassVar[int] = 8
    edges: ClassVar[NDArray[np.int32]] = HEX_EDGES
    faces: ClassVar[NDArray[np.int32]] = HEX_FACES

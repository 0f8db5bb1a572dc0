# SPDX-License-Identifier: Apache-2.0
"""Meshes of hexahedra or tetrahedra: container, generators, selections, quality and import."""

from __future__ import annotations

from gdfe_ros.mesh.generators import bar
from gdfe_ros.mesh.mesh import HexMesh, Mesh
from gdfe_ros.mesh.quality import QualityReport, check_mesh, require_sound
from gdfe_ros.mesh.selection import select_cells, select_faces, select_vertices
from gdfe_ros.mesh.tetmesh import TetMesh

__all__ = [
    "HexMesh",
    "Mesh",
    "QualityReport",
    "TetMesh",
    "bar",
    "check_mesh",
    "require_sound",
    "select_cells",
    "select_faces",
    "select_vertices",
]

# SPDX-License-Identifier: Apache-2.0
"""Construction of layers of fibres from the valid parts of a scene file."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.materials import Material
from gdfe_ros.mesh import Mesh, select_faces
from gdfe_ros.mesh.cavities import boundary_pieces
from gdfe_ros.mesh.cells.face_fibres import FibreLayer, fibre_points, perpendicular_faces
from gdfe_ros.mesh.cells.faces import corners_of, group_faces
from gdfe_ros.scene.building.builder import select
from gdfe_ros.scene.report import NO_VALUE, Defects, Unfit
from gdfe_ros.scene.schemas.material_schema import FibreLayerModel, Wall
from gdfe_ros.scene.schemas.scene_schema import Draft

STIFFEST = 1e4
"""Largest stiffness of a layer, divided by the least Young's modulus and the size of the body. Stiffer fibres hardly
stretch, and rounding errors dominate their tensions."""


def build_fibres(
    draft: Draft, mesh: Mesh | None, materials: Mapping[str, Material], report: Defects
) -> tuple[FibreLayer, ...]:
    """Return the valid layers of fibres; report layers whose name is taken, or whose faces or stiffness do not fit."""
    layers, softest = [], min((item.young0 for item in materials.values()), default=np.inf)
    for name, model in draft.fibres.items() if mesh is not None else ():
        with report.entry("fibres", name):
            layers.append(_layer(name, model, mesh))
            if model.stiffness > (most := STIFFEST * softest * mesh.size):
                bound = f"{STIFFEST:g} times the softest Young's modulus times the body's size"
                text = f"allowed: up to {most:.3g} N/m, {bound}; remedy: this value"
                raise Unfit("stiffness", text, value=model.stiffness)
    return tuple(layers)


def _layer(name: str, model: FibreLayerModel, mesh: Mesh) -> FibreLayer:
    """Return a layer; raise `Unfit` if no face is selected, or if a face is perpendicular to the fibres."""
    if mesh.skin is not None or mesh.filling is not None:
        text = "the faces of voxels are steps, not the wall of the body"
        raise Unfit("", f"{text}; remedy: a mesh of hexahedra or tetrahedra, e.g. mesh: {{tets: ...}}", value=NO_VALUE)
    faces = _wall(mesh, model.wall)
    if model.where is not None:
        chosen = select(select_faces, mesh, model.where, "boundary face")
        group, _ = group_faces(corners_of(np.concatenate([faces, chosen])))
        faces = faces[np.isin(group[: len(faces)], group[len(faces) :])]
    if not len(faces):
        other = Wall.INNER if model.wall is Wall.OUTER else Wall.OUTER
        text = f"no face of the {model.wall.value} wall is there; remedy: wall: {other.value}, or `where`"
        raise Unfit("", text, value=NO_VALUE)
    along = np.array(model.along) / np.abs(model.along).max()
    steep = perpendicular_faces(mesh.vertices, faces, along)
    if len(steep):
        middle = mesh.vertices[corners_of(faces[steep[:1]])].mean(axis=(0, 1))
        place = ", ".join(f"{value:.4g}" for value in middle)
        text = f"{len(steep)} of {len(faces)} faces are perpendicular to this direction, the first at [{place}] m"
        raise Unfit("along", f"{text}; remedy: leave them out with `where`", value=list(model.along))
    families = tuple(fibre_points(mesh.vertices, faces, along, np.radians(angle)) for angle in model.angles_deg)
    return FibreLayer(name=name, stiffness=model.stiffness, compression=model.compression, families=families)


def _wall(mesh: Mesh, wall: Wall) -> NDArray[np.int32]:
    """Return the faces of the outer wall of a body, or of the walls of its cavities."""
    faces = mesh.surface()
    kept = np.zeros(len(faces), dtype=bool)
    for own, volume in boundary_pieces(mesh):
        kept |= own & ((volume < 0.0) is (wall is Wall.OUTER))
    return faces[kept]

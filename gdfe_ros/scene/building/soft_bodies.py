# SPDX-License-Identifier: Apache-2.0
"""Soft bodies beside the main body of a scene.

Selections of vertices, cells or faces refer to the main body only, unless they name a soft body. Soft bodies can
therefore join and leave a scene without changing its handles, regions and loads.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh import HexMesh, Mesh, TetMesh
from gdfe_ros.mesh.assembly import assemble
from gdfe_ros.mesh.mesh import MeshPart
from gdfe_ros.scene.building.builder import fill_regions
from gdfe_ros.scene.building.simulated_mesh import build_part, of_tetrahedra, require_apart
from gdfe_ros.scene.document import Carried
from gdfe_ros.scene.report import Defects
from gdfe_ros.scene.schemas.scene_schema import Draft, RegionModel

MAIN = "mesh"
"""Name of the main body among the parts of the whole mesh, if the scene has the key `mesh`."""


def parts_of(mesh: Mesh) -> dict[str, MeshPart]:
    """Return the meshes of the main body in a dict by name; a single mesh has the name `MAIN`."""
    return dict(mesh.parts) or {MAIN: MeshPart(mesh, np.zeros(3), np.eye(3))}


def build_soft_bodies(draft: Draft, mesh: Mesh | None, carried: Carried, report: Defects) -> dict[str, MeshPart]:
    """Return a dict from name to each valid soft body; report clashes of names, and bodies that overlap.

    Args:
        draft: valid parts of the file.
        mesh: the body of the scene; None if it has defects.
        carried: receives the entries with the contents of their files.
        report: collects the defects.
    """
    if not draft.soft_bodies or mesh is None:
        return {}
    if draft.dynamics is None and not report.concerns("dynamics"):
        text = "nothing holds them; remedy: `dynamics: {}`, with which they can move"
        report.refuse(("soft_bodies",), text)
    own, found = parts_of(mesh), {}
    for name, model in draft.soft_bodies.items():
        path = ("soft_bodies", name)
        if name in own:
            report.refuse(path, "the body has this name; remedy: another one")
            continue
        part = build_part(model, path, carried, report)
        if part is None:
            continue
        if isinstance(mesh, TetMesh):
            part = of_tetrahedra(path, part, report)
        elif isinstance(part.mesh, TetMesh):
            text = "it has tetrahedra, and the body of this scene has hexahedra; remedy: a mesh of hexahedra"
            report.refuse(path, text)
            continue
        found[name] = part
    require_apart({**own, **found}, "soft_bodies", report, among=found)
    return found


def with_soft_bodies(mesh: HexMesh | None, bodies: Mapping[str, MeshPart]) -> HexMesh | None:
    """Return one mesh of the main body and the soft bodies; the main body comes first and keeps its ids."""
    return assemble({**parts_of(mesh), **bodies}) if bodies and mesh is not None else mesh


def assign_soft_materials(draft: Draft, bodies: Mapping[str, MeshPart], report: Defects) -> NDArray[np.int32]:
    """Return the index (m,) int32 of the material of each cell of the soft bodies; -1 for a cell without material."""
    assigned = [np.zeros(0, dtype=np.int32)]
    for name, part in bodies.items():
        model, path = draft.soft_bodies[name], ("soft_bodies", name)
        given = [(each, (*path, "regions", i)) for i, each in enumerate(model.regions)]
        if model.material is not None:
            given = [(RegionModel(material=model.material), path)]
        assigned.append(fill_regions(part.mesh, given, (*path, "regions"), report))
    return np.concatenate(assigned)

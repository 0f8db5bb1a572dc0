# SPDX-License-Identifier: Apache-2.0
"""Construction of obstacles, rigid bodies, self-contact and contact sensors from the valid parts of a scene file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators import Embedding
from gdfe_ros.constraints.form import TriangleMesh
from gdfe_ros.constraints.obstacle import Obstacle, SelfContact
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.errors import MeshError
from gdfe_ros.mesh import HexMesh, select_faces
from gdfe_ros.mesh.cells.tetrahedra import flat_quads
from gdfe_ros.mesh.selection import Where, select_touching, select_touching_faces
from gdfe_ros.mesh.surfaces.solid import Solid
from gdfe_ros.results.contacts import ContactSensor
from gdfe_ros.scene.building.builder import select
from gdfe_ros.scene.document import Carried, KeyPath
from gdfe_ros.scene.report import Defects
from gdfe_ros.scene.schemas.obstacle_schema import BodyModel, ObstacleModel
from gdfe_ros.scene.schemas.scene_schema import Draft

SMALLEST, LARGEST = 1e-3, 1e3
"""Allowed range of a surface's size divided by the body's size; outside of it, the surface's unit is probably wrong."""
COARSEST = 0.25
"""Largest grid spacing of a surface, divided by the body's size; coarser grids do not resolve the shape in contact."""


def build_obstacles(draft: Draft, mesh: HexMesh | None, carried: Carried, report: Defects) -> tuple[Obstacle, ...]:
    """Return the valid obstacles."""
    return tuple(_make(draft.obstacles, "obstacles", mesh, carried, report))


def build_bodies(draft: Draft, mesh: HexMesh | None, carried: Carried, report: Defects) -> tuple[RigidBody, ...]:
    """Return the valid rigid bodies; their vertices follow those of the mesh."""
    first = mesh.n_vertices if mesh is not None else 0
    made = enumerate(_make(draft.bodies, "bodies", mesh, carried, report))
    return tuple(body.renumber(first + 4 * place) for place, body in made)


def _make(
    models: Mapping[str, ObstacleModel | BodyModel],
    section: str,
    mesh: HexMesh | None,
    carried: Carried,
    report: Defects,
) -> Iterator[Obstacle]:
    """Yield the obstacles or rigid bodies of a section; report those whose surface has defects."""
    for name, model in models.items():
        path = (section, name, "mesh")
        try:
            made = model.build(name)
        except MeshError as error:
            report.add_all((*path, model.mesh.chosen[0]), error)
            continue
        if isinstance(made.form, TriangleMesh):
            carried[path] = model.mesh.embed(made.form)
            if mesh is not None:
                _require_scale(made.form.solid, mesh, path, report)
        yield made


def _require_scale(solid: Solid, mesh: HexMesh, path: KeyPath, report: Defects) -> None:
    """Report a solid whose size or grid spacing is implausible compared with the size of the body."""
    ratio = solid.size / mesh.size
    if not SMALLEST <= ratio <= LARGEST:
        allowed = f"allowed: {SMALLEST:g} to {LARGEST:g} times"
        text = (
            f"it measures {solid.size:.3g} m, {ratio:.3g} times as much as the body ({allowed}); remedy: check `scale`"
        )
        report.refuse(path, text)
    elif solid.cell > COARSEST * mesh.size:
        text = f"its cell, {solid.cell:.3g} m, is too coarse for a body of {mesh.size:.3g} m"
        report.refuse(path, f"{text}; remedy: cell: {0.2 * COARSEST * mesh.size:.2g}, or check `scale`")


def build_self_contact(
    draft: Draft, mesh: HexMesh | None, whole: HexMesh | None, report: Defects
) -> SelfContact | None:
    """Return the self-contact of a scene with the faces that may touch; None if there is none or if it has a defect.

    The key `where` limits the faces of the main body ``mesh``. All faces of the soft bodies, which follow it in
    ``whole``, may touch.
    """
    model = draft.self_contact
    if model is None or mesh is None:
        return None
    faces = _touching_faces(whole)
    with report.entry("self_contact"):
        if model.where is not None:
            chosen = select(_touching_faces, mesh, model.where, "boundary face")
            faces = np.concatenate([_renumber(chosen, mesh, whole), _beside(faces, mesh, whole)])
        lined = faces[:, 0] >= whole.n_vertices
        triangles = faces[lined, :3] - np.int32(whole.n_vertices)
        parts = {name: part.first_vertex for name, part in whole.parts.items()}
        laws = {"friction": model.friction, "restitution": model.restitution}
        return SelfContact(quads=faces[~lined], triangles=triangles, parts=parts, **laws)
    return None


def _renumber(faces: NDArray[np.int32], mesh: HexMesh, whole: HexMesh) -> NDArray[np.int32]:
    """Convert the indices of vertices and contact points in faces of ``mesh`` to those in ``whole``."""
    return np.where(faces < mesh.n_vertices, faces, faces + np.int32(whole.n_vertices - mesh.n_vertices))


def _beside(faces: NDArray[np.int32], mesh: HexMesh, whole: HexMesh) -> NDArray[np.int32]:
    """Return the ``faces`` of ``whole`` outside of ``mesh``, which has the first vertices and contact points."""
    points = whole.n_vertices + (0 if mesh.touching is None else len(mesh.touching.corners))
    first = faces[:, 0]
    return faces[np.where(first < whole.n_vertices, first >= mesh.n_vertices, first >= points)]


def _touching_faces(mesh: HexMesh, where: Where | None = None) -> NDArray[np.int32]:
    """Return the contact faces (q, 4) of cells and skins that ``where`` selects; without ``where``, all of them.

    An index i < n_vertices is a vertex; any other index i is the contact point i - n_vertices.
    """
    quads = flat_quads(mesh.surface() if where is None else select_faces(mesh, where))
    if mesh.touching is None:
        return quads
    lined = mesh.touching.faces if where is None else select_touching_faces(mesh, where)
    return np.concatenate([mesh.touching.without(quads), flat_quads(lined) + np.int32(mesh.n_vertices)])


def build_sensors(draft: Draft, mesh: HexMesh | None, report: Defects) -> dict[str, ContactSensor]:
    """Return a dict from name to contact sensor; report sensors without valid faces or contact points."""
    found = {}
    for name, model in draft.sensors.items() if mesh is not None else ():
        with report.entry("sensors", name):
            found[name] = _sensor(name, mesh, model.where)
    return found


def _sensor(name: str, mesh: HexMesh, where: Where) -> ContactSensor:
    touching, part = mesh.touching, mesh.parts.get(where.mesh)
    if touching is None or (where.mesh is not None and (part is None or part.mesh.touching is None)):
        quads = select(select_faces, mesh, where, "boundary face")
        return ContactSensor(name=name, vertices=np.unique(quads).astype(np.int32))
    numbers = select(select_touching, mesh, where, "point of the skin")
    quads = select_faces(mesh, where)
    bare = touching.without(quads)
    points = Embedding(touching.corners[numbers], touching.weights[numbers])
    return ContactSensor(name=name, vertices=np.unique(bare).astype(np.int32), numbers=numbers, points=points)

# SPDX-License-Identifier: Apache-2.0
"""Construction of obstacles, rigid bodies, self-contact and contact sensors from the valid parts of a scene file."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators import Embedding
from gdfe_ros.constraints.form import TriangleMesh
from gdfe_ros.constraints.obstacle import Obstacle, SelfContact
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.contacts import ContactSensor
from gdfe_ros.errors import MeshError
from gdfe_ros.mesh import HexMesh, select_faces
from gdfe_ros.mesh.selection import Where, select_touching, select_touching_faces
from gdfe_ros.mesh.solid import Solid
from gdfe_ros.mesh.tet_faces import flat_quads
from gdfe_ros.scene.builder import holder_of, select
from gdfe_ros.scene.document import KeyPath
from gdfe_ros.scene.obstacle_schema import BodyModel, ObstacleModel
from gdfe_ros.scene.report import NO_VALUE, Defects
from gdfe_ros.scene.schema import Draft
from gdfe_ros.scene.where_schema import WhereModel

SMALLEST, LARGEST = 1e-3, 1e3
"""Allowed range of a surface's size divided by the body's size; outside of it, the surface's unit is probably wrong."""
COARSEST = 0.25
"""Largest grid spacing of a surface, divided by the body's size; coarser grids do not resolve the shape in contact."""


def build_obstacles(draft: Draft, mesh: HexMesh | None, report: Defects) -> tuple[Obstacle, ...]:
    """Return the valid obstacles; report obstacles with the name of a handle, actuator or load."""
    free = [name for name in draft.obstacles if _has_own_name(name, draft, "obstacles", ("handles",), report)]
    made = (_make(name, draft.obstacles[name], "obstacles", mesh, report) for name in free)
    return tuple(obstacle for obstacle in made if obstacle is not None)


def build_bodies(draft: Draft, mesh: HexMesh | None, report: Defects) -> tuple[RigidBody, ...]:
    """Return the valid rigid bodies; report bodies with the name of a handle, obstacle, actuator or load."""
    for name in draft.bodies:
        _has_own_name(name, draft, "bodies", ("handles", "obstacles"), report)
    made = (_make(name, model, "bodies", mesh, report) for name, model in draft.bodies.items())
    first = mesh.n_vertices if mesh is not None else 0
    valid = (body for body in made if body is not None)
    return tuple(body.numbered(first + 4 * place) for place, body in enumerate(valid))


def _has_own_name(name: str, draft: Draft, section: str, others: Sequence[str], report: Defects) -> bool:
    """Return whether no item of ``others``, no actuator and no load has this name; report it if one has."""
    taken = holder_of(name, draft, *others)
    if taken is not None:
        report.add((section, name), f"{taken} has this name; remedy: another one", value=NO_VALUE)
    return taken is None


def _make(
    name: str, model: ObstacleModel | BodyModel, section: str, mesh: HexMesh | None, report: Defects
) -> Obstacle | None:
    """Return an obstacle or rigid body; None if its surface has defects, which are reported."""
    path = (section, name, "mesh")
    try:
        made = model.build(name)
    except MeshError as error:
        for defect in error.defects:
            report.add((*path, model.mesh.chosen[0]), defect)
        return None
    if mesh is not None and isinstance(made.form, TriangleMesh):
        _require_scale(made.form.solid, mesh, path, report)
    return made


def _require_scale(solid: Solid, mesh: HexMesh, path: KeyPath, report: Defects) -> None:
    """Report a solid whose size or grid spacing is implausible compared with the size of the body."""
    ratio = solid.size / mesh.size
    if not SMALLEST <= ratio <= LARGEST:
        allowed = f"allowed: {SMALLEST:g} to {LARGEST:g} times"
        text = (
            f"it measures {solid.size:.3g} m, {ratio:.3g} times as much as the body ({allowed}); remedy: check `scale`"
        )
        report.add(path, text, value=NO_VALUE)
    elif solid.cell > COARSEST * mesh.size:
        text = f"its cell, {solid.cell:.3g} m, is too coarse for a body of {mesh.size:.3g} m"
        report.add(path, f"{text}; remedy: cell: {0.2 * COARSEST * mesh.size:.2g}, or check `scale`", value=NO_VALUE)


def build_self_contact(
    draft: Draft, mesh: HexMesh | None, whole: HexMesh | None, report: Defects
) -> SelfContact | None:
    """Return the self-contact of a scene with the faces that may touch; None if there is none or if it has a defect.

    A place limits the faces of the body ``mesh``; soft bodies, which ``whole`` contains after it, touch everywhere.
    """
    model = draft.self_contact
    if model is None or mesh is None:
        return None
    faces = _touching_faces(whole)
    if model.where is not None:
        chosen = select(_touching_faces, mesh, model.where, ("self_contact", "where"), "boundary face", report)
        if chosen is None:
            return None
        faces = np.concatenate([_renumbered(chosen, mesh, whole), _beside(faces, mesh, whole)])
    lined = faces[:, 0] >= whole.n_vertices
    triangles = faces[lined, :3] - np.int32(whole.n_vertices)
    parts = {name: part.first_vertex for name, part in whole.parts.items()}
    laws = {"friction": model.friction, "restitution": model.restitution}
    return SelfContact(quads=faces[~lined], triangles=triangles, parts=parts, **laws)


def _renumbered(faces: NDArray[np.int32], mesh: HexMesh, whole: HexMesh) -> NDArray[np.int32]:
    """Return faces of ``mesh`` with the numbers that its contact points have in ``whole``."""
    return np.where(faces < mesh.n_vertices, faces, faces + np.int32(whole.n_vertices - mesh.n_vertices))


def _beside(faces: NDArray[np.int32], mesh: HexMesh, whole: HexMesh) -> NDArray[np.int32]:
    """Return those of the faces of ``whole`` that do not belong to ``mesh``, its first vertices and contact points."""
    points = whole.n_vertices + (0 if mesh.touching is None else len(mesh.touching.corners))
    first = faces[:, 0]
    return faces[np.where(first < whole.n_vertices, first >= mesh.n_vertices, first >= points)]


def _touching_faces(mesh: HexMesh, where: Where | None = None) -> NDArray[np.int32]:
    """Return the faces (q, 4) of cells and skins that touch in a place; without a place, all of them.

    Indices from the number of vertices on are those of contact points.
    """
    quads = flat_quads(mesh.surface() if where is None else select_faces(mesh, where))
    if mesh.touching is None:
        return quads
    lined = mesh.touching.faces if where is None else select_touching_faces(mesh, where)
    return np.concatenate([mesh.touching.without(quads), flat_quads(lined) + np.int32(mesh.n_vertices)])


def build_sensors(draft: Draft, mesh: HexMesh | None, report: Defects) -> dict[str, ContactSensor]:
    """Return a dict from name to contact sensor, of the sensors with valid faces or contact points of a skin."""
    found = {}
    for name, model in draft.sensors.items() if mesh is not None else ():
        sensor = _sensor(name, mesh, model.where, report)
        if sensor is not None:
            found[name] = sensor
    return found


def _sensor(name: str, mesh: HexMesh, where: WhereModel, report: Defects) -> ContactSensor | None:
    path, touching = ("sensors", name, "where"), mesh.touching
    part = mesh.parts.get(where.mesh)
    if touching is None or (where.mesh is not None and (part is None or part.mesh.touching is None)):
        quads = select(select_faces, mesh, where, path, "boundary face", report)
        return None if quads is None else ContactSensor(name=name, vertices=np.unique(quads).astype(np.int32))
    numbers = select(select_touching, mesh, where, path, "point of the skin", report)
    if numbers is None:
        return None
    quads = select_faces(mesh, where.build())
    bare = touching.without(quads)
    points = Embedding(touching.corners[numbers], touching.weights[numbers])
    return ContactSensor(name=name, vertices=np.unique(bare).astype(np.int32), numbers=numbers, points=points)

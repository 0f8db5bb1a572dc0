# SPDX-License-Identifier: Apache-2.0
"""Construction of actuators, attached masses, loads and probes from the valid parts of a scene file."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators import (
    Actuator,
    AttachedMass,
    Cable,
    Embedding,
    Gravity,
    Grip,
    Growth,
    Load,
    PointLoad,
    PressureLoad,
    SurfaceLoad,
    embed,
)
from gdfe_ros.actuators.embedding import HALF_A_CELL, SLACK
from gdfe_ros.actuators.load import corner_areas
from gdfe_ros.constraints import Handle
from gdfe_ros.constraints.rigid_body import RigidBody, rigid_among
from gdfe_ros.errors import MeshError
from gdfe_ros.materials import Material, cell_densities, lacks_density
from gdfe_ros.mesh import HexMesh, select_cells, select_faces, select_vertices
from gdfe_ros.mesh.cells.faces import reverse
from gdfe_ros.mesh.selection import select_skin
from gdfe_ros.scene.building.builder import select
from gdfe_ros.scene.building.chambers import build_chamber, on_skin
from gdfe_ros.scene.building.simulated_mesh import require_part
from gdfe_ros.scene.report import NO_VALUE, Defects, Unfit, require_known
from gdfe_ros.scene.scene import Scene
from gdfe_ros.scene.schemas.actuator_schema import (
    AnchorModel,
    CableModel,
    DriveModel,
    GripModel,
    GrowthModel,
    PlaceModel,
    PointLoadModel,
    PressureLoadModel,
    SurfaceLoadModel,
)
from gdfe_ros.scene.schemas.scene_schema import Draft


def build_actuators(
    draft: Draft, mesh: HexMesh | None, handles: Sequence[Handle], report: Defects
) -> tuple[Actuator, ...]:
    """Return the actuators with valid points, faces or cells in the body; report the defects of other entries.

    Each kind of actuator has a function that builds it from its entry, the mesh, the handles, and a dict of the
    arguments that all actuators have: name and mode; if there is a range, also low, high and rate.
    """
    make = {"cable": _build_cable, "chamber": build_chamber, "growth": _build_growth, "grip": _build_grip}
    built = []
    for name, model in draft.actuators.items() if mesh is not None else ():
        kind, value = model.chosen
        with report.entry("actuators", name, kind):
            common = {"name": name, "mode": value.mode}
            if isinstance(value, DriveModel):
                low, high = value.range or value.mode.limits
                common |= {"low": low, "high": high, "rate": value.rate or math.inf}
            built.append(make[kind](value, mesh, handles, common))
            _require_within(built[-1])
    return tuple(built)


def build_masses(
    draft: Draft, mesh: HexMesh | None, probes: Mapping[str, Embedding], report: Defects
) -> tuple[AttachedMass, ...]:
    """Return the attached masses with valid vertices or probes; ``probes`` is a dict of the valid probes by name."""
    found = []
    for name, model in draft.masses.items() if mesh is not None else ():
        with report.entry("masses", name):
            points = probes.get(model.probe)
            if model.where is not None:
                points = Embedding.of_vertices(select(select_vertices, mesh, model.where, "vertex"))
            else:
                require_known("probe", "probe", model.probe, report.names("probes"))
            if points is not None:
                found.append(AttachedMass(name=name, points=points, mass=model.mass))
    return tuple(found)


def build_loads(
    draft: Draft,
    mesh: HexMesh | None,
    whole: HexMesh | None,
    materials: Mapping[str, Material],
    cell_material: NDArray[np.int32],
    masses: tuple[AttachedMass, ...],
    report: Defects,
) -> tuple[Load, ...]:
    """Return the loads with valid points or faces in the body; gravity needs the density of every material.

    Gravity acts on ``whole``, the mesh of the body and all soft bodies; ``cell_material`` is the index of the material
    of each of its cells.
    """
    built, sound = [], len(materials) > cell_material.max(initial=0) and (cell_material >= 0).all()
    make = {"point": _point, "surface": _surface, "pressure": _pressure}
    for name, model in draft.loads.items() if mesh is not None else ():
        kind, value = model.chosen
        with report.entry("loads", name, kind):
            if kind != "gravity":
                built.append(make[kind](name, value, mesh))
            elif text := lacks_density(materials, "gravity needs"):
                raise Unfit("", text)
            elif sound:  # otherwise a material has defects, which are in the report already
                density = cell_densities(materials, cell_material)
                given = {"density": density, "attached": masses, "filling": whole.filling}
                built.append(Gravity(name=name, acceleration=np.array(value), **given))
    return tuple(built)


def build_probes(draft: Draft, mesh: HexMesh | None, report: Defects) -> dict[str, Embedding]:
    """Return a dict from name to material point of the probes inside the body; report probes outside."""
    found = {}
    for name, place in draft.probes.items() if mesh is not None else ():
        part, point = (place.mesh, place.at) if isinstance(place, PlaceModel) else (None, place)
        with report.entry("probes", name):
            found[name] = _embed(mesh, part, [point])
    return found


def neutral_commands(scene: Scene) -> dict[str, float]:
    """Return a dict from actuator or load to the command at which it exerts no force on the undeformed body.

    The command is `Actuator.neutral` for an actuator, and 0 for a load.
    """
    commands = {item.name: item.neutral(scene.mesh.vertices) for item in scene.actuators}
    return {load.name: 0.0 for load in scene.loads} | commands


def _require_within(actuator: Actuator) -> None:
    """Raise `Unfit` if the range of an actuator's commands is wider than its mode allows."""
    mode, (least, most) = actuator.mode, actuator.mode.limits
    if actuator.low < least or actuator.high > most:
        unit = f" [{mode.unit}]" if mode.unit else ""
        raise Unfit("range", f"allowed for {mode.value}{unit}: {least:g} to {most:g}")


def _build_cable(value: CableModel, mesh: HexMesh, handles: Sequence[Handle], common: dict) -> Cable:
    """Return a cable; points up to half a cell outside of the body are moved onto it."""
    world, groups = [], {}
    for number, point in enumerate(value.points):
        if isinstance(point, AnchorModel):
            world.append(number)
        else:
            groups.setdefault(point.mesh if isinstance(point, PlaceModel) else value.mesh, []).append(number)
    count, moved = len(value.points), []
    corners, weights = np.zeros((count, mesh.nodes), np.int32), np.zeros((count, mesh.nodes))
    anchors = np.zeros((count, 3))
    for part, own in groups.items():
        places = [getattr(value.points[number], "at", value.points[number]) for number in own]
        found = _embed(mesh, part, places, "points", reach=HALF_A_CELL[mesh.nodes])
        corners[own], weights[own] = found.corners, found.weights
        moved.append(found.moved)
    if world:
        anchors[world] = [value.points[number].world for number in world]
        corners[world] = corners[next(iter(groups.values()))[0]]  # their weights are zero
    points = Embedding(corners, weights, anchors if world else None, max(moved))
    return Cable(points=points, stiffness=value.stiffness or math.inf, **common)


def _build_growth(value: GrowthModel, mesh: HexMesh, handles: Sequence[Handle], common: dict) -> Growth:
    cells = select(select_cells, mesh, value.where, "cell")
    stretch = np.diag(value.stretch)
    if value.where is not None and value.where.mesh is not None:
        axes = mesh.parts[value.where.mesh].rotation
        stretch = axes @ stretch @ axes.T
    return Growth(cells=cells, stretch=0.5 * (stretch + stretch.T), **common)


def _build_grip(value: GripModel, mesh: HexMesh, handles: Sequence[Handle], common: dict) -> Grip:
    """Return a grip; raise `Unfit` if its holder, or the body or vertices that it holds, are unknown or unsuitable."""
    known = {each.name: each for each in handles}
    require_known("to", "handle, obstacle or body", value.to, known)
    if known[value.to].loose and not isinstance(known[value.to], RigidBody):
        text = f"handle {value.to!r} slides or turns freely; remedy: a handle without `free` and `slide`"
        raise Unfit("to", text)
    common = {**common, "holder": value.to, "reach": value.reach}
    if value.body is not None:
        require_known("body", "body", value.body, [each.name for each in rigid_among(handles)])
        return Grip(held=value.body, vertices=np.zeros(0, np.int32), **common)
    vertices = select(select_vertices, mesh, value.where, "vertex")
    taken = [each.name for each in handles if np.isin(vertices, each.vertices).any()]
    if taken:
        text = f"handles hold some of these vertices already: {', '.join(taken)}; remedy: make the place smaller"
        raise Unfit("where", text)
    return Grip(vertices=vertices, **common)


def _point(name: str, value: PointLoadModel, mesh: HexMesh) -> PointLoad:
    return PointLoad(name=name, point=_embed(mesh, value.mesh, [value.at], "at"), force=np.array(value.force))


def _surface(name: str, value: SurfaceLoadModel, mesh: HexMesh) -> SurfaceLoad:
    """Return a load on faces of the body, or on the skin of cut cells."""
    traction = value.traction
    lined = traction is not None and mesh.filling is not None and mesh.skin is not None
    if traction is not None and mesh.filling is not None and not lined:
        text = "faces of cut cells are larger than the surface in them; remedy: `skin: {file: ...}`, to which"
        raise Unfit("traction", f"{text} the traction is then applied; or give the whole `force`, or cells: whole")
    selector, noun = (select_skin, "triangle of the skin") if lined else (select_faces, "boundary face")
    quads = select(selector, mesh, value.where, noun)
    points, quads = on_skin(mesh.skin, quads[:, [0, 1, 2, 2]]) if lined else (None, quads)
    if traction is None:
        traction = np.array(value.force) / corner_areas(mesh.vertices, quads).sum()
    return SurfaceLoad(name=name, quads=quads, traction=np.array(traction), points=points)


def _pressure(name: str, value: PressureLoadModel, mesh: HexMesh) -> PressureLoad:
    """Return a follower pressure on faces of the body."""
    if mesh.filling is not None:
        text = "faces of cut cells lie beside the surface; remedy: a `chamber` on the skin, or cells: whole"
        raise Unfit("where", text, value=NO_VALUE)
    faces = select(select_faces, mesh, value.where, "boundary face")
    return PressureLoad(name=name, quads=reverse(faces), pressure=value.pressure)


def _embed(mesh: HexMesh, part: str | None, points: object, key: str = "", *, reach: float = SLACK) -> Embedding:
    """Return the material points at given positions (p, 3) [m].

    If ``part`` names one of several meshes, the points are in this mesh, and the positions are in its frame. ``key`` is
    the key of the scene entry that gives the points. ``reach`` is an argument of `embed`.

    Raises:
        Unfit: there is no such mesh, or a point is outside of it.
    """
    require_part(mesh, part)
    within, first = (mesh, 0) if part is None else (mesh.parts[part].mesh, mesh.parts[part].first_vertex)
    try:
        found = embed(within, points, what=key, reach=reach)
    except MeshError as error:
        frame = "" if part is None else f", in the frame of mesh {part!r}"
        raise Unfit(key, *(f"{defect}{frame}" for defect in error.defects), value=NO_VALUE) from error
    return replace(found, corners=found.corners + np.int32(first))

# SPDX-License-Identifier: Apache-2.0
"""Construction of actuators, attached masses, loads and probes from the valid parts of a scene file."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

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
    Mode,
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
from gdfe_ros.mesh.cavities import inside_volume
from gdfe_ros.mesh.faces import turned
from gdfe_ros.mesh.selection import select_skin
from gdfe_ros.scene.actuator_schema import (
    AnchorModel,
    CableModel,
    DriveModel,
    GripModel,
    GrowthModel,
    LoadModel,
    PlaceModel,
    PressureLoadModel,
)
from gdfe_ros.scene.builder import select
from gdfe_ros.scene.chambers import chamber, on_skin
from gdfe_ros.scene.document import KeyPath
from gdfe_ros.scene.meshes import known_part
from gdfe_ros.scene.report import NO_VALUE, Defects, suggest
from gdfe_ros.scene.schema import Draft

#: Widest allowed range (low, high) of the commands of each mode, in the mode's unit.
LIMITS: Mapping[Mode, tuple[float, float]] = {
    Mode.TENSION: (0.0, math.inf),
    Mode.LENGTH: (0.0, math.inf),
    Mode.SHORTENING: (-math.inf, math.inf),
    Mode.PRESSURE: (-math.inf, math.inf),
    Mode.VOLUME: (0.0, math.inf),
    Mode.GROWTH: (0.0, 1.0),
}


def build_actuators(
    draft: Draft, mesh: HexMesh | None, handles: Sequence[Handle], report: Defects
) -> tuple[Actuator, ...]:
    """Return the actuators whose points, faces or cells in the body are valid; report the defects of the others."""
    built = []
    for name, model in draft.actuators.items() if mesh is not None else ():
        kind, value = model.chosen
        path = ("actuators", name, kind)
        if kind == "grip":
            built.append(_grip(name, value, mesh, handles, path, report))
            continue
        low, high = _limits(value, model.mode, path, report)
        common = {"name": name, "mode": model.mode, "low": low, "high": high, "rate": value.rate or math.inf}
        make = {"cable": _cable, "chamber": partial(chamber, handles=handles), "growth": _growth}[kind]
        built.append(make(value, mesh, common, path, report))
    return tuple(actuator for actuator in built if actuator is not None)


def build_masses(
    draft: Draft, mesh: HexMesh | None, probes: Mapping[str, Embedding], names: Sequence[str], report: Defects
) -> tuple[AttachedMass, ...]:
    """Return the attached masses whose vertices or probes are valid.

    Args:
        draft: valid parts of the file.
        mesh: the body; None if it has defects.
        probes: dict from the name of each valid probe to its material point.
        names: names of all probes of the file.
        report: collects the defects.
    """
    found = []
    for name, model in draft.masses.items() if mesh is not None else ():
        points = probes.get(model.probe)
        if model.where is not None:
            vertices = select(select_vertices, mesh, model.where, ("masses", name, "where"), "vertex", report)
            points = None if vertices is None else Embedding.of_vertices(vertices)
        elif model.probe not in names:
            report.add(("masses", name, "probe"), f"there is no such probe{suggest(model.probe, names)}")
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
    """Return the loads whose points or faces in the body are valid; gravity needs the density of every material.

    Gravity acts on ``whole``, the body and all soft bodies beside it, whose cells have the materials ``cell_material``.
    """
    built = []
    for name, model in draft.loads.items() if mesh is not None else ():
        path = ("loads", name, model.chosen[0])
        if name in draft.actuators:
            report.add(("loads", name), "an actuator has this name; remedy: another name", value=NO_VALUE)
        load = _load(name, model, mesh, materials, cell_material, path, report)
        if isinstance(load, Gravity):
            load = replace(load, attached=masses, filling=whole.filling)
        built.append(load)
    return tuple(load for load in built if load is not None)


def build_probes(draft: Draft, mesh: HexMesh | None, report: Defects) -> dict[str, Embedding]:
    """Return a dict from the name of each probe inside the body to its material point; report the other probes."""
    if mesh is None:
        return {}
    found = {}
    for name, place in draft.probes.items():
        part, point = (place.mesh, place.at) if isinstance(place, PlaceModel) else (None, place)
        found[name] = _embedded(mesh, part, [point], ("probes", name), report)
    return {name: point for name, point in found.items() if point is not None}


def neutral_commands(mesh: HexMesh, actuators: tuple[Actuator, ...], loads: tuple[Load, ...]) -> dict[str, float]:
    """Return a dict from the name of each actuator and load to the command that leaves the body undeformed.

    It is the undeformed length [m] of a cable with a commanded length, the undeformed volume [m^3] of a chamber with a
    commanded volume, and 0 for all others.
    """
    commands = {load.name: 0.0 for load in loads}
    for actuator in actuators:
        commands[actuator.name] = 0.0
        if actuator.mode is Mode.LENGTH:
            points = actuator.points.at(mesh.vertices)
            commands[actuator.name] = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        elif actuator.mode is Mode.VOLUME:
            commands[actuator.name] = inside_volume(actuator.at(mesh.vertices), actuator.quads)
    return commands


def _limits(value: DriveModel, mode: Mode, path: KeyPath, report: Defects) -> tuple[float, float]:
    least, most = LIMITS[mode]
    low, high = value.range or (least, most)
    if low < least or high > most:
        unit = f" [{mode.unit}]" if mode.unit else ""
        report.add((*path, "range"), f"allowed for {mode.value}{unit}: {least:g} to {most:g}")
    return low, high


def _cable(value: CableModel, mesh: HexMesh, common: dict, path: KeyPath, report: Defects) -> Cable | None:
    """Return a cable; points up to half a cell outside of the body are moved onto it."""
    world, groups = [], {}
    for number, point in enumerate(value.points):
        if isinstance(point, AnchorModel):
            world.append(number)
        else:
            groups.setdefault(point.mesh if isinstance(point, PlaceModel) else value.mesh, []).append(number)
    count = len(value.points)
    corners, weights, anchors = (
        np.zeros((count, mesh.nodes), np.int32),
        np.zeros((count, mesh.nodes)),
        np.zeros((count, 3)),
    )
    moved = [0.0]
    for part, own in groups.items():
        places = [getattr(value.points[number], "at", value.points[number]) for number in own]
        found = _embedded(mesh, part, places, path, report, key="points", reach=HALF_A_CELL[mesh.nodes])
        if found is not None:
            corners[own], weights[own] = found.corners, found.weights
            moved.append(found.moved)
    if len(moved) <= len(groups):
        return None
    if world:
        anchors[world] = [value.points[number].world for number in world]
        corners[world] = corners[next(iter(groups.values()))[0]]  # their weights are zero
    points = Embedding(corners, weights, anchors if world else None, max(moved))
    return Cable(points=points, stiffness=value.stiffness or math.inf, **common)


def _growth(value: GrowthModel, mesh: HexMesh, common: dict, path: KeyPath, report: Defects) -> Growth | None:
    cells = select(select_cells, mesh, value.where, (*path, "where"), "cell", report)
    if cells is None:
        return None
    stretch = np.diag(value.stretch)
    if value.where is not None and value.where.mesh is not None:
        axes = mesh.parts[value.where.mesh].rotation
        stretch = axes @ stretch @ axes.T
    return Growth(cells=cells, stretch=0.5 * (stretch + stretch.T), **common)


def _grip(
    name: str, value: GripModel, mesh: HexMesh, handles: Sequence[Handle], path: KeyPath, report: Defects
) -> Grip | None:
    """Return a grip; None if its holder or what it holds is unknown or unsuitable, which is reported."""
    known = {each.name: each for each in handles}
    holder = known.get(value.to)
    if holder is None:
        report.add((*path, "to"), f"there is no such handle, obstacle or body{suggest(value.to, known)}")
        return None
    if holder.loose and not isinstance(holder, RigidBody):
        text = f"handle {value.to!r} slides or turns freely; remedy: a handle without `free` and `slide`"
        report.add((*path, "to"), text)
        return None
    common = {"name": name, "mode": Mode.GRIP, "holder": value.to, "reach": value.reach}
    if value.body is not None:
        bodies = [each.name for each in rigid_among(handles)]
        if value.body not in bodies:
            report.add((*path, "body"), f"there is no such body{suggest(value.body, bodies)}")
            return None
        return Grip(held=value.body, vertices=np.zeros(0, np.int32), **common)
    vertices = select(select_vertices, mesh, value.where, (*path, "where"), "vertex", report)
    if vertices is None:
        return None
    taken = [each.name for each in handles if np.isin(vertices, each.vertices).any()]
    if taken:
        text = f"handles hold some of these vertices already: {', '.join(taken)}; remedy: make the place smaller"
        report.add((*path, "where"), text)
        return None
    return Grip(vertices=vertices, **common)


def _load(
    name: str,
    model: LoadModel,
    mesh: HexMesh,
    materials: Mapping[str, Material],
    cell_material: NDArray[np.int32],
    path: KeyPath,
    report: Defects,
) -> Load | None:
    if model.gravity is not None:
        return _gravity(name, model.gravity, materials, cell_material, path, report)
    if model.point is not None:
        point = _embedded(mesh, model.point.mesh, [model.point.at], path, report, key="at")
        return None if point is None else PointLoad(name=name, point=point, force=np.array(model.point.force))
    if model.pressure is not None:
        return _pressure(name, model.pressure, mesh, path, report)
    traction = model.surface.traction
    lined = traction is not None and mesh.filling is not None and mesh.skin is not None
    if traction is not None and mesh.filling is not None and not lined:
        text = "faces of cut cells are larger than the surface in them; remedy: `skin: {file: ...}`, to which"
        text += " the traction is then applied; or give the whole `force`, or cells: whole"
        report.add((*path, "traction"), text)
        return None
    selector, noun = (select_skin, "triangle of the skin") if lined else (select_faces, "boundary face")
    quads = select(selector, mesh, model.surface.where, (*path, "where"), noun, report)
    if quads is None:
        return None
    points, quads = on_skin(mesh.skin, quads[:, [0, 1, 2, 2]]) if lined else (None, quads)
    if traction is None:
        traction = np.array(model.surface.force) / corner_areas(mesh.vertices, quads).sum()
    return SurfaceLoad(name=name, quads=quads, traction=np.array(traction), points=points)


def _pressure(
    name: str, model: PressureLoadModel, mesh: HexMesh, path: KeyPath, report: Defects
) -> PressureLoad | None:
    """Return a follower pressure; None if its faces are not on the surface, or there are none, which is reported."""
    if mesh.filling is not None:
        text = "faces of cut cells lie beside the surface; remedy: a `chamber` on the skin, or cells: whole"
        report.add((*path, "where"), text, value=NO_VALUE)
        return None
    faces = select(select_faces, mesh, model.where, (*path, "where"), "boundary face", report)
    return None if faces is None else PressureLoad(name=name, quads=turned(faces), pressure=model.pressure)


def _gravity(
    name: str,
    acceleration: tuple[float, float, float],
    materials: Mapping[str, Material],
    cell_material: NDArray[np.int32],
    path: KeyPath,
    report: Defects,
) -> Gravity | None:
    if text := lacks_density(materials, "gravity needs"):
        report.add(path, text)
        return None
    if (cell_material < 0).any() or cell_material.max() >= len(materials):
        return None  # a material has defects, which are in the report already
    return Gravity(name=name, acceleration=np.array(acceleration), density=cell_densities(materials, cell_material))


def _embedded(
    mesh: HexMesh,
    part: str | None,
    points: object,
    path: KeyPath,
    report: Defects,
    *,
    key: str | None = None,
    reach: float = SLACK,
) -> Embedding | None:
    """Return the material points at given positions (p, 3) [m]; None if a point is outside, which is reported.

    If ``part`` names one of several meshes, the points are in this mesh, and the positions are in its frame. ``path``
    is the key path of the entry with the key `mesh`. ``key`` is the key of the points in this entry, and ``reach`` the
    argument of `embed`.
    """
    if not known_part(mesh, part, path, report):
        return None
    within, first = (mesh, 0) if part is None else (mesh.parts[part].mesh, mesh.parts[part].first_vertex)
    path = path if key is None else (*path, key)
    try:
        found = embed(within, points, what=".".join(map(str, path)), reach=reach)
    except MeshError as error:
        for defect in error.defects:
            frame = "" if part is None else f", in the frame of mesh {part!r}"
            report.add(path, f"{defect}{frame}", value=NO_VALUE)
        return None
    return replace(found, corners=found.corners + np.int32(first))

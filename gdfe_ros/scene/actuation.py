# SPDX-License-Identifier: Apache-2.0
"""From a scene file's sound parts to actuators, attached masses, loads, probes and contact sensors."""

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
    Chamber,
    Embedding,
    Gravity,
    Growth,
    Load,
    Mode,
    PointLoad,
    SurfaceLoad,
    embed,
)
from gdfe_ros.actuators.load import corner_areas
from gdfe_ros.contacts import ContactSensor
from gdfe_ros.errors import MeshError
from gdfe_ros.materials import Material, cell_densities, lacks_density
from gdfe_ros.mesh import HexMesh, select_cells, select_faces, select_vertices
from gdfe_ros.mesh.cavities import Cavity, find_cavities, open_edges, skin_cavities
from gdfe_ros.mesh.faces import enclosed_volume
from gdfe_ros.mesh.quality import list_ids
from gdfe_ros.mesh.selection import select_skin
from gdfe_ros.scene.actuator_schema import CableModel, ChamberModel, DriveModel, GrowthModel, LoadModel
from gdfe_ros.scene.builder import select
from gdfe_ros.scene.document import KeyPath
from gdfe_ros.scene.report import NO_VALUE, Report, suggest
from gdfe_ros.scene.schema import Draft

#: Widest allowed range of a command.
LIMITS: Mapping[Mode, tuple[float, float]] = {
    Mode.TENSION: (0.0, math.inf),
    Mode.LENGTH: (0.0, math.inf),
    Mode.SHORTENING: (-math.inf, math.inf),
    Mode.PRESSURE: (-math.inf, math.inf),
    Mode.VOLUME: (0.0, math.inf),
    Mode.GROWTH: (0.0, 1.0),
}


def build_actuators(draft: Draft, mesh: HexMesh | None, report: Report) -> tuple[Actuator, ...]:
    """Return the actuators whose place in the body can be found."""
    built = []
    for name, model in draft.actuators.items() if mesh is not None else ():
        kind, value = model.chosen
        path = ("actuators", name, kind)
        low, high = _limits(value, model.mode, path, report)
        common = {"name": name, "mode": model.mode, "low": low, "high": high, "rate": value.rate or math.inf}
        make = {"cable": _cable, "chamber": _chamber, "growth": _growth}[kind]
        built.append(make(value, mesh, common, path, report))
    return tuple(actuator for actuator in built if actuator is not None)


def build_masses(
    draft: Draft, mesh: HexMesh | None, probes: Mapping[str, Embedding], names: Sequence[str], report: Report
) -> tuple[AttachedMass, ...]:
    """Return the attached masses whose place in the body can be found.

    Args:
        draft: the file's sound parts.
        mesh: the body.
        probes: those that lie in it.
        names: of all probes of the file.
        report: takes the defects.
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
    materials: Mapping[str, Material],
    cell_material: NDArray[np.int32],
    masses: tuple[AttachedMass, ...],
    report: Report,
) -> tuple[Load, ...]:
    """Return the loads whose place in the body can be found; gravity needs the density of every material."""
    built = []
    for name, model in draft.loads.items() if mesh is not None else ():
        path = ("loads", name, model.chosen[0])
        if name in draft.actuators:
            report.add(("loads", name), "an actuator has this name; remedy: another name", value=NO_VALUE)
        load = _load(name, model, mesh, materials, cell_material, path, report)
        built.append(replace(load, attached=masses) if isinstance(load, Gravity) else load)
    return tuple(load for load in built if load is not None)


def build_probes(draft: Draft, mesh: HexMesh | None, report: Report) -> dict[str, Embedding]:
    """Return the probes that lie in the body."""
    if mesh is None:
        return {}
    found = {name: _embedded(mesh, [point], ("probes", name), report) for name, point in draft.probes.items()}
    return {name: point for name, point in found.items() if point is not None}


def build_sensors(draft: Draft, mesh: HexMesh | None, report: Report) -> dict[str, ContactSensor]:
    """Return the contact sensors whose faces can be found."""
    found = {}
    for name, model in draft.sensors.items() if mesh is not None else ():
        quads = select(select_faces, mesh, model.where, ("sensors", name, "where"), "boundary face", report)
        if quads is not None:
            found[name] = ContactSensor(name=name, vertices=np.unique(quads).astype(np.int32))
    return found


def neutral_commands(mesh: HexMesh, actuators: tuple[Actuator, ...], loads: tuple[Load, ...]) -> dict[str, float]:
    """Return the command of every actuator and load at which it does nothing to the body at rest."""
    commands = {load.name: 0.0 for load in loads}
    for actuator in actuators:
        commands[actuator.name] = 0.0
        if actuator.mode is Mode.LENGTH:
            points = actuator.points.at(mesh.vertices)
            commands[actuator.name] = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        elif actuator.mode is Mode.VOLUME:
            commands[actuator.name] = enclosed_volume(actuator.at(mesh.vertices), actuator.quads)
    return commands


def _limits(value: DriveModel, mode: Mode, path: KeyPath, report: Report) -> tuple[float, float]:
    least, most = LIMITS[mode]
    low, high = value.range or (least, most)
    if low < least or high > most:
        unit = f" [{mode.unit}]" if mode.unit else ""
        report.add((*path, "range"), f"allowed for {mode.value}{unit}: {least:g} to {most:g}")
    return low, high


def _cable(value: CableModel, mesh: HexMesh, common: dict, path: KeyPath, report: Report) -> Cable | None:
    points = _embedded(mesh, value.points, (*path, "points"), report)
    return None if points is None else Cable(points=points, stiffness=value.stiffness or math.inf, **common)


def _chamber(value: ChamberModel, mesh: HexMesh, common: dict, path: KeyPath, report: Report) -> Chamber | None:
    if mesh.filling is not None:
        return _lined_chamber(value, mesh, common, path, report)
    if value.where is not None:
        faces = select(select_faces, mesh, value.where, (*path, "where"), "boundary face", report)
        if faces is None:
            return None
        quads = np.ascontiguousarray(faces[:, ::-1])
        return Chamber(quads=quads, **common) if _tight(mesh, quads, (*path, "where"), report) else None
    lack = "the body has no closed cavity; remedy: `where` names the faces, `gdfe inspect` shows leaks"
    cavity = _chosen(value, find_cavities(mesh), lack, path, report)
    return None if cavity is None else Chamber(quads=cavity.quads, **common)


def _lined_chamber(value: ChamberModel, mesh: HexMesh, common: dict, path: KeyPath, report: Report) -> Chamber | None:
    """Return a chamber whose pressure acts on the skin: faces of cut cells lie beside the surface."""
    if value.where is not None:
        text = "it would name faces of cut cells, which lie beside the surface; remedy: cavity, near, or cells: whole"
        report.add((*path, "where"), text, value=NO_VALUE)
        return None
    if mesh.skin is None:
        text = (
            "where cells are cut its pressure acts on the skin; remedy: `skin: {file: ...}` with the mesh's surface, "
        )
        report.add(path, f"{text}or cells: whole", value=NO_VALUE)
        return None
    lack = "the skin has no closed shell within another one; remedy: a skin with the chamber's walls, closed"
    cavity = _chosen(value, skin_cavities(mesh), lack, path, report)
    if cavity is None:
        return None
    points, quads = _on_skin(mesh, cavity.quads)
    return Chamber(quads=quads, points=points, **common)


def _chosen(value: ChamberModel, cavities: Sequence[Cavity], lack: str, path: KeyPath, report: Report) -> Cavity | None:
    """Return the cavity that is meant; ``lack`` is what to say where there is none."""
    known = ", ".join(f"{i}: {c.volume:.3g} m^3 near {np.round(c.center, 6).tolist()}" for i, c in enumerate(cavities))
    if not cavities:
        report.add(path, lack)
    elif value.near is not None:
        centers = np.array([cavity.center for cavity in cavities])
        nearest = int(np.linalg.norm(centers - value.near, axis=1).argmin())
        return cavities[nearest]
    elif value.cavity is None and len(cavities) > 1:
        report.add(path, f"the body has {len(cavities)} cavities ({known}); remedy: name one by cavity or near")
    elif (value.cavity or 0) >= len(cavities):
        report.add((*path, "cavity"), f"there are: {known}")
    else:
        return cavities[value.cavity or 0]
    return None


def _tight(mesh: HexMesh, quads: NDArray[np.int32], path: KeyPath, report: Report) -> bool:
    leaks = open_edges(quads)
    if len(leaks):
        x, y, z = mesh.vertices[leaks[0]].mean(axis=0)
        text = (
            f"these {len(quads)} faces leak at {len(leaks)} edges, the first at ({x:.4g}, {y:.4g}, {z:.4g}) m between "
            f"vertices {list_ids(np.unique(leaks))}; remedy: select every face of the chamber, close its ends"
        )
        report.add(path, text, value=NO_VALUE)
        return False
    if enclosed_volume(mesh.vertices, quads) <= 0.0:
        report.add(path, "these faces enclose the body itself, not a chamber in it; select inner faces", value=NO_VALUE)
        return False
    return True


def _growth(value: GrowthModel, mesh: HexMesh, common: dict, path: KeyPath, report: Report) -> Growth | None:
    cells = select(select_cells, mesh, value.where, (*path, "where"), "cell", report)
    return None if cells is None else Growth(cells=cells, stretch=np.diag(value.stretch), **common)


def _load(
    name: str,
    model: LoadModel,
    mesh: HexMesh,
    materials: Mapping[str, Material],
    cell_material: NDArray[np.int32],
    path: KeyPath,
    report: Report,
) -> Load | None:
    if model.gravity is not None:
        gravity = _gravity(name, model.gravity, materials, cell_material, path, report)
        return None if gravity is None else replace(gravity, filling=mesh.filling)
    if model.point is not None:
        point = _embedded(mesh, [model.point.at], (*path, "at"), report)
        return None if point is None else PointLoad(name=name, point=point, force=np.array(model.point.force))
    traction = model.surface.traction
    lined = traction is not None and mesh.filling is not None and mesh.skin is not None
    if traction is not None and mesh.filling is not None and not lined:
        text = (
            "faces of cut cells are larger than the surface in them; remedy: `skin: {file: ...}`, which it acts on then"
        )
        report.add((*path, "traction"), f"{text}, give the whole `force`, or cells: whole")
        return None
    selector, noun = (select_skin, "triangle of the skin") if lined else (select_faces, "boundary face")
    quads = select(selector, mesh, model.surface.where, (*path, "where"), noun, report)
    if quads is None:
        return None
    points, quads = _on_skin(mesh, quads[:, [0, 1, 2, 2]]) if lined else (None, quads)
    if traction is None:
        traction = np.array(model.surface.force) / corner_areas(mesh.vertices, quads).sum()
    return SurfaceLoad(name=name, quads=quads, traction=np.array(traction), points=points)


def _on_skin(mesh: HexMesh, quads: NDArray[np.int32]) -> tuple[Embedding, NDArray[np.int32]]:
    """Return the points of the skin that some faces of it lie between, and the faces by their numbers among these."""
    used, local = np.unique(quads, return_inverse=True)
    points = Embedding(mesh.skin.corners[used], mesh.skin.weights[used])
    return points, local.reshape(quads.shape).astype(np.int32)


def _gravity(
    name: str,
    acceleration: tuple[float, float, float],
    materials: Mapping[str, Material],
    cell_material: NDArray[np.int32],
    path: KeyPath,
    report: Report,
) -> Gravity | None:
    if text := lacks_density(materials, "gravity needs"):
        report.add(path, text)
        return None
    if (cell_material < 0).any() or cell_material.max() >= len(materials):
        return None  # a material has defects, which are in the report
    return Gravity(name=name, acceleration=np.array(acceleration), density=cell_densities(materials, cell_material))


def _embedded(mesh: HexMesh, points: object, path: KeyPath, report: Report) -> Embedding | None:
    try:
        return embed(mesh, points, what=".".join(map(str, path)))
    except MeshError as error:
        for defect in error.defects:
            report.add(path, defect, value=NO_VALUE)
        return None

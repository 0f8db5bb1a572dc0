# SPDX-License-Identifier: Apache-2.0
"""Construction of materials, handles and a program from the valid parts of a scene file, with cross checks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators import Actuator, Load
from gdfe_ros.arms.arm import Arm
from gdfe_ros.constraints import Axis, Handle
from gdfe_ros.errors import MeshError
from gdfe_ros.materials import Material
from gdfe_ros.mesh import HexMesh, Mesh, select_cells, select_vertices
from gdfe_ros.mesh.faces import vertex_pieces
from gdfe_ros.mesh.quality import list_ids
from gdfe_ros.mesh.selection import Where
from gdfe_ros.scene.document import KeyPath
from gdfe_ros.scene.meshes import known_part
from gdfe_ros.scene.obstacle_schema import ObstacleModel
from gdfe_ros.scene.program import JointPoint, Point, Program
from gdfe_ros.scene.report import NO_VALUE, Defects, suggest
from gdfe_ros.scene.schema import Draft, HandleModel, KeyframeModel, ProgramModel
from gdfe_ros.scene.where_schema import WhereModel

_TESTED = {
    "cell": "cell centroids",
    "point of the skin": "points about half a cell's edge apart",
}
"""Dict from a kind of items to the points that a selection of such items tests; for other kinds, the vertices."""


def build_materials(draft: Draft, report: Defects) -> dict[str, Material]:
    """Return a dict from the name of each valid material to the material."""
    materials = {}
    for name, model in draft.materials.items():
        try:
            materials[name] = model.build()
        except ValueError as error:
            report.add(("materials", name), str(error))
    return materials


def assign_materials(draft: Draft, mesh: HexMesh | None, names: list[str], report: Defects) -> NDArray[np.int32]:
    """Return the index into ``names`` of each cell's material (m,), int32; -1 for a cell without a material."""
    regions = [(each, ("regions", i)) for i, each in enumerate(draft.regions) if each is not None]
    given = [(each.material, each.where, path, (*path, "material")) for each, path in regions]
    complete = len(draft.regions) > 0 and None not in draft.regions
    return fill_regions(mesh, given, names, ("regions",), report, complete=complete)


def fill_regions(
    mesh: Mesh | None,
    regions: Iterable[tuple[str, WhereModel | None, KeyPath, KeyPath]],
    names: Sequence[str],
    path: KeyPath,
    report: Defects,
    *,
    complete: bool = True,
) -> NDArray[np.int32]:
    """Return the index into ``names`` of each cell's material (m,), int32; -1 for a cell without a material.

    Args:
        mesh: mesh of the cells; None if it has defects.
        regions: material, place, key path of the region, and key path of its material, of each region.
        names: names of all materials.
        path: key path of the list of regions.
        report: collects the defects.
        complete: whether no region has been left out because of a defect; if so, all cells must have a material.
    """
    assigned = np.full(mesh.n_cells if mesh is not None else 0, -1, dtype=np.int32)
    for material, where, place, key in regions:
        if material not in names:
            report.add(key, f"there is no such material{suggest(material, names)}")
        cells = None if mesh is None else select(select_cells, mesh, where, (*place, "where"), "cell", report)
        if material in names and cells is not None:
            assigned[cells] = names.index(material)
        else:
            complete = False
    bare = np.flatnonzero(assigned < 0)
    if complete and len(bare):
        text = f"{len(bare)} cells have no material: {list_ids(bare)}; remedy: begin with a region without `where`"
        report.add(path, text, value=NO_VALUE)
    return assigned


def build_handles(draft: Draft, mesh: HexMesh | None, report: Defects) -> tuple[Handle, ...]:
    """Return the handles with valid vertices; report a vertex that belongs to two handles."""
    handles = []
    for name, model in draft.handles.items() if mesh is not None else ():
        vertices = select(select_vertices, mesh, model.where, ("handles", name, "where"), "vertex", report)
        if vertices is not None:
            handles.append(_handle(name, vertices, model))
    handles = list(_apart(handles))
    for handle in handles:
        if not len(handle.vertices):
            text = "each of its vertices belongs to other handles; remedy: remove it"
            report.add(("handles", handle.name, "where"), text, value=NO_VALUE)
    for first, second in combinations(handles, 2):
        shared = np.intersect1d(first.vertices, second.vertices)
        if len(shared):
            report.add(
                ("handles", second.name, "where"),
                f"handles {first.name!r} and {second.name!r} both hold vertices {list_ids(shared)}; "
                "remedy: make one of the two smaller",
            )
    return tuple(handles)


def _handle(name: str, vertices: NDArray[np.int32], model: HandleModel) -> Handle:
    if not model.slide:
        return Handle(name, vertices, fixed=model.fixed, free=model.axes, turning=model.turning)
    axes = tuple(axis for axis in Axis if axis.name.lower() in model.slide)
    rows = np.tile(np.isin(list(Axis), axes), (len(vertices), 1))
    return Handle(name, vertices, fixed=True, free=axes, slide=rows)


def _apart(handles: Sequence[Handle]) -> Iterator[Handle]:
    """Yield the handles without vertices on rollers that belong to others: rigid ones, or rollers before them.

    A vertex on several rollers slides only along the axes that all of them leave free.
    """
    for number, handle in enumerate(handles):
        if handle.slide is None:
            yield handle
            continue
        slide = handle.slide.copy()
        rigid = [each.vertices for each in handles if each.slide is None and not each.loose]
        taken = np.isin(handle.vertices, np.concatenate([np.zeros(0, np.int32), *rigid]))
        for place, other in enumerate(handles):
            if other.slide is not None and place != number:
                both = np.isin(handle.vertices, other.vertices)
                slide[both] &= other.slide[0]
                taken |= both & (place < number)
        yield replace(handle, vertices=handle.vertices[~taken], slide=slide[~taken])


def require_held(mesh: HexMesh, handles: tuple[Handle, ...], report: Defects) -> None:
    """Report each piece of the body that no handle constrains along some axis: its position would be undetermined."""
    part = vertex_pieces(mesh.cells, mesh.n_vertices)
    for axis, letter in enumerate("xyz"):
        pieces_of = {handle.name: set(part[handle.vertices].tolist()) for handle in handles}
        held = set().union(*(pieces_of[handle.name] for handle in handles if axis not in handle.free))
        sliding = [pieces_of[handle.name] for handle in handles if axis in handle.free]
        for _ in sliding:
            held.update(*(pieces for pieces in sliding if pieces & held))
        for piece in sorted(set(range(int(part.max()) + 1)) - held):
            whole = _piece(mesh, np.flatnonzero(part == piece))
            remedy = f"add a handle there that is fixed or not free in {letter}, or `dynamics: {{}}` to let it move"
            text = f"no handle holds {whole} along {letter}; remedy: {remedy}"
            report.add(("handles",), text, value=NO_VALUE)


def _piece(mesh: HexMesh, vertices: NDArray[np.intp]) -> str:
    """Return a text that names the piece of the body with exactly these vertices."""
    if len(vertices) == mesh.n_vertices:
        return "the body"
    for name, part in mesh.parts.items():
        own = vertices - part.first_vertex
        if 0 <= own[0] < part.mesh.n_vertices:
            whole = len(own) == part.mesh.n_vertices
            return f"mesh {name!r}" if whole else f"the piece of mesh {name!r} with its vertices {list_ids(own)}"
    return f"the piece with the vertices {list_ids(vertices)}"


def build_program(
    model: ProgramModel,
    draft: Draft,
    named: Mapping[str, list[str]],
    report: Defects,
    *,
    actuators: Sequence[Actuator] = (),
    loads: Sequence[Load] = (),
    start: Mapping[str, float] | None = None,
    arms: Sequence[Arm] | None = (),
) -> Program:
    """Return the program; report unknown or immovable items, and times that do not ascend or exceed the duration.

    Args:
        model: the program of the file.
        draft: valid parts of the file.
        named: dict from section (handles, obstacles, actuators and loads) to the names of all its items in the file,
            also of those with defects.
        report: collects the defects.
        actuators: actuators of the scene.
        loads: loads of the scene.
        start: dict from the name of an item to its command at time 0, if its first command is at a later time.
        arms: arms of the scene; None if an arm has defects.
    """
    carriers = {arm.handle: arm.name for arm in arms or ()}
    for section in ("handles", "obstacles"):
        names = named[section]
        known: Mapping[str, HandleModel | ObstacleModel] = getattr(draft, section)
        for name, frames in getattr(model, section).items():
            path = ("program", section, name)
            if name not in names:
                report.add(path, f"there is no such {section[:-1]}{suggest(name, names)}", value=NO_VALUE)
            elif name in known:
                _check_movable(known[name], section[:-1], frames, path, report)
            if section == "handles" and name in carriers:
                text = f"arm {carriers[name]!r} carries this handle; remedy: program.joints, positions of its joints"
                report.add(path, text, value=NO_VALUE)
            if not frames:
                report.add(path, "there is no keyframe; give e.g. [{time: 1.0, translation: [0, 0, 0.1]}]")
            _check_times(frames, model.duration, path, report)
    ranges = {actuator.name: (actuator.low, actuator.high) for actuator in actuators}
    driven = _tracks(model.actuators, "actuators", named["actuators"], ranges, model.duration, report)
    factors = _tracks(model.loads, "loads", named["loads"], {}, model.duration, report)
    joints = _joint_tracks(model, arms, report)
    moved = {**model.handles, **model.obstacles}
    keyframes = {name: tuple(frame.build() for frame in frames) for name, frames in moved.items()}
    own = {name: (start or {}).get(name, 0.0) for name in (*driven, *factors, *joints)}
    return Program(model.duration, keyframes, driven, factors, own, joints)


def _joint_tracks(
    model: ProgramModel, arms: Sequence[Arm] | None, report: Defects
) -> dict[str, tuple[JointPoint, ...]]:
    """Return the positions of joints over time; report unknown joints and positions or velocities beyond the limits."""
    limits = {joint.name: joint.limits for arm in arms or () for joint in arm.joints}
    for name, points in model.joints.items():
        path = ("program", "joints", name)
        if arms is not None and name not in limits:
            report.add(path, f"there is no such joint{suggest(name, limits)}", value=NO_VALUE)
        if not points:
            report.add(path, "there is no point; give e.g. [{time: 1.0, value: 0.5}]")
        _check_times(points, model.duration, path, report)
        for i, point in enumerate(points if name in limits else ()):
            low, high, fast = limits[name].lower, limits[name].upper, limits[name].velocity
            if not low <= point.value <= high:
                report.add((*path, i, "value"), f"allowed by the joint's limits: {low:g} to {high:g}")
            if abs(point.velocity) > fast:
                report.add((*path, i, "velocity"), f"allowed by the joint's limit: {-fast:g} to {fast:g}")
    return dict(model.joints)


def _check_times(
    frames: Sequence[KeyframeModel | Point | JointPoint], duration: float, path: KeyPath, report: Defects
) -> None:
    for i, frame in enumerate(frames):
        if frame.time > duration:
            report.add((*path, i, "time"), f"allowed are times up to the duration, {duration:g} s")
        if i and frame.time <= frames[i - 1].time:
            report.add((*path, i, "time"), f"times must ascend; the one before is {frames[i - 1].time:g} s")


def _tracks(
    tracks: Mapping[str, tuple[Point, ...]],
    section: str,
    names: list[str],
    ranges: Mapping[str, tuple[float, float]],
    duration: float,
    report: Defects,
) -> dict[str, tuple[Point, ...]]:
    """Return the commands of actuators or loads over time; report unknown items and commands out of range."""
    for name, points in tracks.items():
        path = ("program", section, name)
        if name not in names:
            report.add(path, f"there is no such {section[:-1]}{suggest(name, names)}", value=NO_VALUE)
        if not points:
            report.add(path, "there is no keyframe; give e.g. [{time: 1.0, value: 1.0}]")
        _check_times(points, duration, path, report)
        low, high = ranges.get(name, (-np.inf, np.inf))
        for i, point in enumerate(points):
            if not low <= point.value <= high:
                report.add((*path, i, "value"), f"allowed by the actuator's range: {low:g} to {high:g}")
    return dict(tracks)


def _check_movable(
    handle: HandleModel | ObstacleModel,
    noun: str,
    frames: tuple[KeyframeModel, ...],
    path: KeyPath,
    report: Defects,
) -> None:
    if handle.fixed:
        report.add(path, f"this {noun} is fixed; remedy: remove `fixed: true` or this entry", value=NO_VALUE)
    if isinstance(handle, ObstacleModel):
        return
    for i, frame in enumerate(frames):
        for axis in handle.axes:
            if frame.translation[axis]:
                letter = axis.name.lower()
                text = f"{letter} is free and cannot be commanded; use 0 for {letter}"
                report.add((*path, i, "translation"), text)
        for axis in handle.turning:
            if frame.rotation_deg[axis]:
                letter = f"r{axis.name.lower()}"
                text = f"{letter} is free and cannot be commanded; use 0 for {letter}"
                report.add((*path, i, "rotation_deg"), text)


def holder_of(name: str, draft: Draft, *sections: str) -> str | None:
    """Return the kind of item that has a name, e.g. ``a handle``; None if no item of the ``sections`` has it.

    Actuators and loads count in any case, because they, contacts and fibres are terms of one potential.
    """
    kinds = {
        "handles": "a handle",
        "obstacles": "an obstacle",
        "bodies": "a body",
        "actuators": "an actuator",
        "loads": "a load",
    }
    found = [kinds[section] for section in (*sections, "actuators", "loads") if name in getattr(draft, section)]
    return found[0] if found else None


def select(
    selector: Callable[[HexMesh, Where], NDArray[np.int32]],
    mesh: HexMesh,
    where: WhereModel | None,
    path: KeyPath,
    noun: str,
    report: Defects,
) -> NDArray[np.int32] | None:
    """Return the ids that a `where` selects; report an invalid or empty selection and return None.

    ``selector`` is a function of `mesh.selection`, e.g. `select_cells`. Without a `where`, the ids of all cells are
    returned.
    """
    if where is None:
        return np.arange(mesh.n_cells, dtype=np.int32)
    if not all([known_part(mesh, name, path, report) for name in where.names]):
        return None
    try:
        ids = selector(mesh, where.build())
    except MeshError as error:
        for defect in error.defects:
            report.add(path, defect)
        return None
    if len(ids):
        return ids
    own = mesh.parts[where.mesh].mesh if where.mesh is not None else mesh
    name = f"mesh {where.mesh!r} in its own frame" if where.mesh is not None else "the mesh"
    extent = ", ".join(f"{axis} {a:g} to {b:g}" for axis, a, b in zip("xyz", *own.bounds, strict=True))
    points = _TESTED.get(noun, "vertices")
    given = where.model_dump(exclude_none=True)
    report.add(path, f"no {noun} is there; {name} spans {extent} [m] and {points} are tested", value=given)
    return None

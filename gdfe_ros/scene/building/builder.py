# SPDX-License-Identifier: Apache-2.0
"""Construction of materials, handles and a program from the valid parts of a scene file, with cross checks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints import Axis, Handle
from gdfe_ros.errors import MeshError
from gdfe_ros.materials import Material
from gdfe_ros.mesh import HexMesh, Mesh, select_cells, select_vertices
from gdfe_ros.mesh.cells.faces import vertex_pieces
from gdfe_ros.mesh.quality import list_ids
from gdfe_ros.mesh.selection import Where
from gdfe_ros.scene.building.simulated_mesh import require_part
from gdfe_ros.scene.document import Carried, KeyPath, without
from gdfe_ros.scene.report import WHOLE, Defects, Unfit, require_known
from gdfe_ros.scene.schemas.scene_schema import Draft, HandleModel, RegionModel

_TESTED = {"cell": "cell centroids", "point of the skin": "points about half a cell's edge apart"}
"""Points that a selection tests for each kind of item, named in errors; for other kinds: vertices."""


def build_materials(draft: Draft, carried: Carried, report: Defects) -> dict[str, Material]:
    """Return a dict from the name of each valid material to the material."""
    materials = {}
    for name, model in draft.materials.items():
        path = ("materials", name)
        try:
            materials[name] = model.build()
        except ValueError as error:
            report.add(path, str(error))
        if (table := getattr(model, "csv", None)) is not None:
            points = {"strain": list(table.strain), "stress": list(table.stress)}
            carried[path] = without(report.value_at(path, plain=False), "csv") | points
    return materials


def assign_materials(draft: Draft, mesh: HexMesh | None, report: Defects) -> NDArray[np.int32]:
    """Return the index of each cell's material (m,), int32; -1 for a cell without a material."""
    given = [(each, ("regions", i)) for i, each in enumerate(draft.regions) if each is not None]
    complete = len(draft.regions) > 0 and None not in draft.regions
    return fill_regions(mesh, given, ("regions",), report, complete=complete)


def fill_regions(
    mesh: Mesh | None,
    regions: Sequence[tuple[RegionModel, KeyPath]],
    path: KeyPath,
    report: Defects,
    *,
    complete: bool = True,
) -> NDArray[np.int32]:
    """Return the index of each cell's material (m,), int32; -1 for a cell without a material.

    Args:
        mesh: mesh of the cells; None if it has defects.
        regions: regions with their key paths; later ones win.
        path: key path of the list of regions.
        report: collects the defects.
        complete: whether ``regions`` has all regions of the file, because none has a defect. Each cell must then have a
            material.
    """
    names = report.names("materials")
    assigned = np.full(mesh.n_cells if mesh is not None else 0, -1, dtype=np.int32)
    filled = 0
    for region, place in regions:
        with report.entry(*place):
            require_known("material", "material", region.material, names)
        with report.entry(*place):
            cells = [] if mesh is None else select(select_cells, mesh, region.where, "cell")
            if region.material in names:
                assigned[cells] = names.index(region.material)
                filled += 1
    bare = np.flatnonzero(assigned < 0)
    if complete and filled == len(regions) and len(bare):
        text = f"{len(bare)} cells have no material: {list_ids(bare)}; remedy: begin with a region without `where`"
        report.refuse(path, text)
    return assigned


def build_handles(draft: Draft, mesh: HexMesh | None, report: Defects) -> tuple[Handle, ...]:
    """Return the handles with valid vertices; report vertices that belong to two handles."""
    handles = []
    for name, model in draft.handles.items() if mesh is not None else ():
        with report.entry("handles", name):
            handles.append(_handle(name, select(select_vertices, mesh, model.where, "vertex"), model))
    handles = list(_apart(handles))
    for handle in handles:
        if not len(handle.vertices):
            text = "each of its vertices belongs to other handles; remedy: remove it"
            report.refuse(("handles", handle.name, "where"), text)
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
    """Yield the handles after rollers (handles with `slide`) have given up vertices that they share.

    A roller leaves a shared vertex to a rigid handle that does not slide or turn. Several rollers leave a shared vertex
    to the first of them. The vertex then slides only along the axes that all of these rollers leave free. A force along
    another axis is a reaction of the first roller that holds this axis.
    """
    for number, handle in enumerate(handles):
        if handle.slide is None:
            yield handle
            continue
        slide, holds = handle.slide.copy(), ~handle.slide
        rigid = [each.vertices for each in handles if each.slide is None and not each.loose]
        taken = np.isin(handle.vertices, np.concatenate([np.zeros(0, np.int32), *rigid]))
        holds[taken] = False
        for place, other in enumerate(handles):
            if other.slide is not None and place != number:
                both = np.isin(handle.vertices, other.vertices)
                slide[both] &= other.slide[0]
                if place < number:
                    holds[both] &= other.slide[0]
                    taken |= both
        own = handle.vertices[~taken]
        yield replace(handle, vertices=own, slide=slide[~taken], bears=(handle.vertices, holds))


def require_held(mesh: HexMesh, handles: Iterable[Handle], report: Defects) -> None:
    """Report pieces of the body that no handle constrains along some axis; their position would be undetermined."""
    for letter, vertices in find_unheld(mesh, handles):
        remedy = f"add a handle there that is fixed or not free in {letter}, or `dynamics: {{}}` to let it move"
        report.refuse(("handles",), f"no handle holds {name_piece(mesh, vertices)} along {letter}; remedy: {remedy}")


def find_unheld(mesh: HexMesh, handles: Iterable[Handle]) -> Iterator[tuple[str, NDArray[np.intp]]]:
    """Yield an axis letter and the vertices (k,) of a piece, for pieces that no handle holds along this axis."""
    part = vertex_pieces(mesh.cells, mesh.n_vertices)
    reached = [(handle.free, set(part[handle.vertices].tolist())) for handle in handles]
    for axis, letter in enumerate("xyz"):
        held = set().union(*(pieces for free, pieces in reached if axis not in free))
        sliding = [pieces for free, pieces in reached if axis in free]
        for _ in sliding:
            held.update(*(pieces for pieces in sliding if pieces & held))
        for piece in sorted(set(range(int(part.max()) + 1)) - held):
            yield letter, np.flatnonzero(part == piece)


def name_piece(mesh: Mesh, vertices: NDArray[np.intp]) -> str:
    """Return a text that names the piece of the body with exactly these vertices."""
    if len(vertices) == mesh.n_vertices:
        return "the body"
    for name, part in mesh.parts.items():
        own = vertices - part.first_vertex
        if 0 <= own[0] < part.mesh.n_vertices:
            whole = len(own) == part.mesh.n_vertices
            return f"mesh {name!r}" if whole else f"the piece of mesh {name!r} with its vertices {list_ids(own)}"
    sets = [name for name, ids in mesh.cell_sets.items() if len(ids) and np.isin(mesh.cells[ids], vertices).all()]
    return f"the piece {', '.join([*sets, ''])}with the vertices {list_ids(vertices)}"


KINDS = {
    "handles": "a handle",
    "obstacles": "an obstacle",
    "bodies": "a body",
    "actuators": "an actuator",
    "loads": "a load",
}
"""Dict from a section of a scene file to the noun of its items in messages."""
_OTHERS = {
    "obstacles": ("handles", "actuators", "loads"),
    "bodies": ("handles", "obstacles", "actuators", "loads"),
    "fibres": tuple(KINDS),
    "soft_bodies": tuple(KINDS),
    "loads": ("actuators",),
}
"""Dict from section to the sections with which it may share no name, because names identify the terms of the potential.
"""


def require_own_names(draft: Draft, report: Defects) -> None:
    """Report items that have the name of an item of another section."""
    for section, others in _OTHERS.items():
        for name in getattr(draft, section):
            taken = next((KINDS[other] for other in others if name in getattr(draft, other)), None)
            if taken is not None:
                report.refuse((section, name), f"{taken} has this name; remedy: another one")


def select(
    selector: Callable[[HexMesh, Where], NDArray[np.int32]], mesh: HexMesh, where: Where | None, noun: str
) -> NDArray[np.int32]:
    """Return the ids that the key `where` of an entry selects; without `where`, the ids of all cells.

    ``selector`` is a function of `mesh.selection`, e.g. `select_cells`.

    Raises:
        Unfit: the selection is invalid or empty.
    """
    if where is None:
        return np.arange(mesh.n_cells, dtype=np.int32)
    for name in where.names:
        require_part(mesh, name, "where.mesh")
    try:
        ids = selector(mesh, where)
    except MeshError as error:
        raise Unfit("where", *error.defects) from error
    if len(ids):
        return ids
    own = mesh.parts[where.mesh].mesh if where.mesh is not None else mesh
    name = f"mesh {where.mesh!r} in its own frame" if where.mesh is not None else "the mesh"
    extent = ", ".join(f"{axis} {a:g} to {b:g}" for axis, a, b in zip("xyz", *own.bounds, strict=True))
    text = f"no {noun} is there; {name} spans {extent} [m] and {_TESTED.get(noun, 'vertices')} are tested"
    raise Unfit("where", text, value=WHOLE)

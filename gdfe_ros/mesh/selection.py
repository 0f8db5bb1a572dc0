# SPDX-License-Identifier: Apache-2.0
"""Selections of vertices, cells or faces of a mesh, as in the key `where` of a scene."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh.cavities import corners_of
from gdfe_ros.mesh.mesh import Mesh, MeshPart
from gdfe_ros.mesh.touching import Touching

#: Points this close to a box or sphere still count as inside, as a fraction of the mesh size: coordinates such
#: as 0.1 * 3 are not exact.
INSIDE_SLACK = 1e-9
#: Vertices this close to the extreme coordinate lie on a face: imported coordinates may be single precision.
FACE_SLACK = 1e-6


class Side(Enum):
    """A side of the bounding box: axis and direction."""

    X_LOW = "x-"
    X_HIGH = "x+"
    Y_LOW = "y-"
    Y_HIGH = "y+"
    Z_LOW = "z-"
    Z_HIGH = "z+"


@dataclass(frozen=True)
class Face:
    """Vertices on one side of the bounding box. In a selection of cells: the cells with at least one such vertex."""

    side: Side


@dataclass(frozen=True)
class BoxSelection:
    """Points within closed intervals [low, high] [m]; None does not limit an axis."""

    x: tuple[float, float] | None = None
    y: tuple[float, float] | None = None
    z: tuple[float, float] | None = None


@dataclass(frozen=True)
class SphereSelection:
    """Points within `radius` [m] of `center` [m]."""

    center: tuple[float, float, float]
    radius: float


@dataclass(frozen=True)
class Vertices:
    """Vertices by id. In a selection of cells: the cells all of whose vertices are among the ids."""

    ids: tuple[int, ...]


@dataclass(frozen=True)
class CellSelection:
    """Cells by id. In a selection of vertices: the vertices of these cells."""

    ids: tuple[int, ...]


@dataclass(frozen=True)
class NamedSet:
    """A vertex set or cell set of the mesh by name; it is converted like `Vertices` or `CellSelection`."""

    name: str


@dataclass(frozen=True)
class Within:
    """A selection in one mesh of an assembly, in the frame and the ids of this mesh; without ``where``, all of it."""

    part: str
    where: Where | None = None


@dataclass(frozen=True)
class AnyOf:
    """Union of several selections."""

    places: tuple[Where, ...]


Where = Face | BoxSelection | SphereSelection | Vertices | CellSelection | NamedSet | Within | AnyOf


def select_vertices(mesh: Mesh, where: Where) -> NDArray[np.int32]:
    """Return the sorted vertex ids of a selection; it may be empty.

    Args:
        mesh: the mesh.
        where: the selection; boxes and spheres are closed, and extended by 1e-9 of the mesh size.

    Returns:
        Vertex ids, int32, sorted, unique.

    Raises:
        MeshError: an id is out of range, or a set or a mesh is unknown.
    """
    match where:
        case Face(side):
            return _ids(_on_side(mesh, side))
        case BoxSelection() | SphereSelection():
            return _ids(inside_of(mesh, mesh.vertices, where))
        case Vertices(ids):
            return _checked(ids, mesh.n_vertices, "vertex")
        case CellSelection(ids):
            return _vertices_of(mesh, _checked(ids, mesh.n_cells, "cell"))
        case Within(name, inner):
            part = part_of(mesh, name)
            own = np.arange(part.mesh.n_vertices) if inner is None else select_vertices(part.mesh, inner)
            return (own + part.first_vertex).astype(np.int32)
        case AnyOf(places):
            return united(select_vertices(mesh, place) for place in places)
        case NamedSet(name) if name in mesh.vertex_sets:
            return mesh.vertex_sets[name]
        case NamedSet(name) if name in mesh.cell_sets:
            return _vertices_of(mesh, mesh.cell_sets[name])
        case NamedSet(name):
            raise _unknown_set(mesh, name)


def select_cells(mesh: Mesh, where: Where) -> NDArray[np.int32]:
    """Return the sorted cell ids of a selection; it may be empty.

    Boxes and spheres select cells by their centroids. The selection classes describe the other rules.

    Args:
        mesh: the mesh.
        where: the selection.

    Returns:
        Cell ids, int32, sorted, unique.

    Raises:
        MeshError: an id is out of range, or a set or a mesh is unknown.
    """
    match where:
        case Face(side):
            return _ids(_on_side(mesh, side)[mesh.cells].any(axis=1))
        case BoxSelection() | SphereSelection():
            return _ids(inside_of(mesh, mesh.centroids, where))
        case Vertices(ids):
            return _cells_within(mesh, _checked(ids, mesh.n_vertices, "vertex"))
        case CellSelection(ids):
            return _checked(ids, mesh.n_cells, "cell")
        case Within(name, inner):
            part = part_of(mesh, name)
            own = np.arange(part.mesh.n_cells) if inner is None else select_cells(part.mesh, inner)
            return (own + part.first_cell).astype(np.int32)
        case AnyOf(places):
            return united(select_cells(mesh, place) for place in places)
        case NamedSet(name) if name in mesh.cell_sets:
            return mesh.cell_sets[name]
        case NamedSet(name) if name in mesh.vertex_sets:
            return _cells_within(mesh, mesh.vertex_sets[name])
        case NamedSet(name):
            raise _unknown_set(mesh, name)


def select_faces(mesh: Mesh, where: Where) -> NDArray[np.int32]:
    """Return the boundary faces whose corners are all selected; there may be none.

    In an `AnyOf`, a single one of its selections must contain all corners of a face.

    Args:
        mesh: the mesh.
        where: the selection, as for `select_vertices`.

    Returns:
        Vertex ids, shape (q, 4) or (q, 6), int32, normals out of the material.

    Raises:
        MeshError: an id is out of range, or a set or a mesh is unknown.
    """
    faces, all_selected = mesh.surface(), False
    for place in where.places if isinstance(where, AnyOf) else (where,):
        chosen = np.zeros(mesh.n_vertices, dtype=bool)
        chosen[select_vertices(mesh, place)] = True
        all_selected = all_selected | chosen[corners_of(faces)].all(axis=1)
    return faces[all_selected]


def part_of(mesh: Mesh, name: str) -> MeshPart:
    """Return the mesh with a given name in an assembly, with its pose.

    Raises:
        MeshError: there is no mesh of this name.
    """
    if name in mesh.parts:
        return mesh.parts[name]
    known = f"there are: {', '.join(mesh.parts)}" if mesh.parts else "there is one mesh, which has no name"
    raise MeshError("the selection does not fit the mesh", [f"mesh {name!r} does not exist; {known}"])


def united(selected: Iterable[NDArray[np.int32]]) -> NDArray[np.int32]:
    """Return the sorted union of several selections."""
    return np.unique(np.concatenate([np.zeros(0, np.int32), *selected])).astype(np.int32)


def _on_side(mesh: Mesh, side: Side) -> NDArray[np.bool_]:
    return at_end(mesh.vertices, side, FACE_SLACK * mesh.size)


def at_end(points: NDArray[np.float64], side: Side, slack: float) -> NDArray[np.bool_]:
    """Return whether each point is on a side of the bounding box of all points, within ``slack`` [m]."""
    coordinate = points[:, "xyz".index(side.value[0])]
    if side.value[1] == "-":
        return coordinate <= coordinate.min() + slack
    return coordinate >= coordinate.max() - slack


def inside_of(mesh: Mesh, points: NDArray[np.float64], where: BoxSelection | SphereSelection) -> NDArray[np.bool_]:
    """Return whether each point lies in a box or sphere, extended by 1e-9 of the mesh size."""
    slack = INSIDE_SLACK * mesh.size
    if isinstance(where, SphereSelection):
        return np.linalg.norm(points - where.center, axis=1) <= where.radius + slack
    inside = np.ones(len(points), dtype=bool)
    for axis, interval in enumerate((where.x, where.y, where.z)):
        if interval is not None:
            inside &= (points[:, axis] >= interval[0] - slack) & (points[:, axis] <= interval[1] + slack)
    return inside


def _ids(mask: NDArray[np.bool_]) -> NDArray[np.int32]:
    return np.flatnonzero(mask).astype(np.int32)


def _checked(ids: tuple[int, ...], count: int, noun: str) -> NDArray[np.int32]:
    wrong = [i for i in ids if not 0 <= i < count]
    if wrong:
        raise MeshError(
            "the selection does not fit the mesh",
            [f"{noun} ids {wrong[:10]} do not exist; allowed: 0 to {count - 1}"],
        )
    return np.unique(np.asarray(ids, dtype=np.int32))


def _vertices_of(mesh: Mesh, cells: NDArray[np.int32]) -> NDArray[np.int32]:
    return np.unique(mesh.cells[cells])


def _cells_within(mesh: Mesh, vertices: NDArray[np.int32]) -> NDArray[np.int32]:
    chosen = np.zeros(mesh.n_vertices, dtype=bool)
    chosen[vertices] = True
    return _ids(chosen[mesh.cells].all(axis=1))


def _unknown_set(mesh: Mesh, name: str) -> MeshError:
    known = sorted({*mesh.cell_sets, *mesh.vertex_sets})
    text = f"there are: {', '.join(known)}" if known else "the mesh has no sets; use face, box or ids"
    return MeshError("the selection does not fit the mesh", [f"set {name!r} does not exist; {text}"])


def select_skin(mesh: Mesh, where: Where) -> NDArray[np.int32]:
    """Return the triangles (t, 3) int32 of a mesh's skin whose three points are selected; there may be none.

    A `Face` refers to the bounding box of the skin.

    Raises:
        MeshError: the selection is by ids, sets or the name of a mesh; these refer to cells and not to a skin.
    """
    if isinstance(where, AnyOf):
        return np.unique(np.concatenate([select_skin(mesh, place) for place in where.places]), axis=0)
    chosen = _chosen(mesh, mesh.skin.at(mesh.vertices), where)
    return mesh.skin.faces[chosen[mesh.skin.faces].all(axis=1)]


def select_touching(mesh: Mesh, where: Where) -> NDArray[np.int32]:
    """Return the sorted indices of the selected contact points of a mesh's skin; there may be none.

    A `Face` refers to the bounding box of the skin.

    Raises:
        MeshError: the selection is by ids or sets, which refer to cells and not to a skin, or a mesh is unknown.
    """
    if isinstance(where, AnyOf):
        return united(select_touching(mesh, place) for place in where.places)
    if isinstance(where, Within):
        first, touching = sum(len(each.corners) for each in _before(mesh, where)), _part(mesh, where).touching
        if touching is None:
            return np.zeros(0, np.int32)
        count = len(touching.corners)
        own = np.arange(count) if where.where is None else select_touching(_part(mesh, where), where.where)
        return (own + first).astype(np.int32)
    points, ends = mesh.touching.at(mesh.vertices), mesh.outside.at(mesh.vertices)
    return np.flatnonzero(_chosen(mesh, np.concatenate([points, ends]), where)[: len(points)]).astype(np.int32)


def select_touching_faces(mesh: Mesh, where: Where) -> NDArray[np.int32]:
    """Return the triangles (t, 3) int32 of contact points whose three points are selected; there may be none.

    In an `AnyOf`, a single one of its selections must contain all three.

    Raises:
        MeshError: as for `select_touching`.
    """
    faces, selected = mesh.touching.faces, False
    for place in where.places if isinstance(where, AnyOf) else (where,):
        selected = selected | np.isin(faces, select_touching(mesh, place)).all(axis=1)
    return faces[selected]


def _part(mesh: Mesh, where: Within) -> Mesh:
    return part_of(mesh, where.part).mesh


def _before(mesh: Mesh, where: Within) -> list[Touching]:
    """Return the contact points of the meshes before the one in which a selection is."""
    last = part_of(mesh, where.part).first_vertex
    before = [each.mesh.touching for each in mesh.parts.values() if each.first_vertex < last]
    return [each for each in before if each is not None]


def _chosen(mesh: Mesh, points: NDArray[np.float64], where: Where) -> NDArray[np.bool_]:
    """Return whether each of ``points`` (k, 3) [m] of a skin is selected."""
    match where:
        case Face(side):
            return at_end(points, side, FACE_SLACK * mesh.size)
        case BoxSelection() | SphereSelection():
            return inside_of(mesh, points, where)
        case _:
            raise MeshError(
                "the selection does not fit the skin",
                ["ids, sets and names of meshes are those of cells, not of a skin; allowed: face, box, sphere"],
            )

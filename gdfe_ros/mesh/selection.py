# SPDX-License-Identifier: Apache-2.0
"""Selections of vertices, cells or faces of a mesh, as in the key `where` of a scene."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import Enum
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.errors import MeshError
from gdfe_ros.keys import Alternatives, FieldError, Keys, Meaning
from gdfe_ros.mesh.cells.faces import corners_of
from gdfe_ros.mesh.mesh import Mesh, MeshPart
from gdfe_ros.mesh.touching import Touching
from gdfe_ros.quantity import ANY, Quantity, Vector

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


Interval = Annotated[
    tuple[float, float], Quantity("interval [low, high] of the coordinate", "m", count=2, ascending=True, infinite=True)
]
Ids = Annotated[tuple[int, ...], Quantity("ids, from 0", least=0, most=2**31 - 1, count=ANY, whole=True)]
_UNION = Meaning(
    "the union of several selections, e.g. the roots of two fingers on one flange: "
    "[{mesh: left, face: x-}, {mesh: right, face: x-}]"
)
_MESH = Meaning("name of one of the `meshes`; coordinates and ids are then its own; without another key: all of it")


@dataclass(frozen=True)
class BoxSelection(Keys):
    """A box of closed intervals [m]; without an interval the box is not limited along the axis."""

    x: Interval | None = None
    y: Interval | None = None
    z: Interval | None = None

    def __post_init__(self) -> None:
        if self.x is self.y is self.z is None:
            raise ValueError("give at least one axis, e.g. box: {x: [0.0, 0.1]}")


@dataclass(frozen=True)
class SphereSelection(Keys):
    """A ball, with its centre and its radius."""

    center: Annotated[Vector, Quantity("center [x, y, z]", "m", count=3)]
    radius: Annotated[float, Quantity("radius", "m", above=0.0)]


@dataclass(frozen=True, kw_only=True)
class Where(Alternatives, Keys):
    """A selection by exactly one of these keys, in the whole body or in one of the `meshes`; `any` unites several.

    Where cells are needed, a face selects the cells with at least one of its vertices. ``vertices`` select the cells
    whose vertices are all listed. Boxes and spheres select the cells whose centroids are inside. Where vertices are
    needed, cells select all of their vertices. A set is converted like ``vertices`` or ``cells``.
    """

    options: ClassVar[tuple[str, ...]] = ("mesh",)
    alone: ClassVar[tuple[str, ...]] = ("mesh",)

    face: Annotated[Side | None, Meaning("vertices at the smallest (-) or largest (+) coordinate of the body")] = None
    box: BoxSelection | None = None
    sphere: SphereSelection | None = None
    vertices: Ids | None = None
    cells: Ids | None = None
    set: Annotated[str | None, Meaning("name of a set in the mesh file")] = None
    any: Annotated[tuple[Where, ...] | None, _UNION] = None
    mesh: Annotated[str | None, _MESH] = None

    def __post_init__(self) -> None:
        if self.any == ():
            raise FieldError("any", (), f"must not be empty; needed: {_UNION.text}")
        self.require_one()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the meshes to which the selection refers."""
        own = () if self.mesh is None else (self.mesh,)
        return own + tuple(name for place in self.any or () for name in place.names)

    @property
    def places(self) -> tuple[Where, ...]:
        """The united selections of ``any``; this selection alone if it is no union, or is limited to one mesh."""
        return (self,) if self.any is None or self.mesh is not None else self.any

    @property
    def inner(self) -> Where:
        """This selection without the key ``mesh``, for use in that mesh; all of the mesh if no other key is left."""
        own = {name: value for name, value in vars(self).items() if value is not None and name != "mesh"}
        return Where(**own or {"box": BoxSelection(x=(-math.inf, math.inf))})


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
    return _select(mesh, where, of_cells=False)


def select_cells(mesh: Mesh, where: Where) -> NDArray[np.int32]:
    """Return the sorted cell ids of a selection; it may be empty. Arguments and errors are as for `select_vertices`."""
    return _select(mesh, where, of_cells=True)


def _select(mesh: Mesh, where: Where, *, of_cells: bool) -> NDArray[np.int32]:
    """Return the sorted ids of the selected cells or vertices."""
    match where:
        case Where(mesh=str(name)):
            part = part_of(mesh, name)
            first = part.first_cell if of_cells else part.first_vertex
            return _select(part.mesh, where.inner, of_cells=of_cells) + np.int32(first)
        case Where(any=tuple(places)):
            return unite(_select(mesh, place, of_cells=of_cells) for place in places)
        case Where(face=Side() as side):
            there = at_end(mesh.vertices, side, FACE_SLACK * mesh.size)
            return _ids(there[mesh.cells].any(axis=1) if of_cells else there)
        case Where(box=None, sphere=None):
            vertices, cells = _list(mesh, where)
            if of_cells:
                return _ids(np.isin(mesh.cells, vertices).all(axis=1)) if cells is None else cells
            return np.unique(mesh.cells[cells]) if vertices is None else vertices
    return _ids(inside_of(mesh, mesh.centroids if of_cells else mesh.vertices, where))


def _list(mesh: Mesh, where: Where) -> tuple[NDArray[np.int32] | None, NDArray[np.int32] | None]:
    """Return the vertices and the cells that a selection by ids or by a set lists; None where it lists none."""
    match where:
        case Where(vertices=tuple(ids)):
            return _check(ids, mesh.n_vertices, "vertex"), None
        case Where(cells=tuple(ids)):
            return None, _check(ids, mesh.n_cells, "cell")
    found = mesh.vertex_sets.get(where.set), mesh.cell_sets.get(where.set)
    if found[0] is None and found[1] is None:
        known = sorted({*mesh.cell_sets, *mesh.vertex_sets})
        text = f"there are: {', '.join(known)}" if known else "the mesh has no sets; use face, box or ids"
        raise MeshError("the selection does not fit the mesh", [f"set {where.set!r} does not exist; {text}"])
    return found


def select_faces(mesh: Mesh, where: Where) -> NDArray[np.int32]:
    """Return the boundary faces whose corners are all selected; there may be none.

    In a union, one of the united selections must contain all corners of a face.

    Args:
        mesh: the mesh.
        where: the selection, as for `select_vertices`.

    Returns:
        Vertex ids, shape (q, 4) or (q, 6), int32, normals out of the material.

    Raises:
        MeshError: an id is out of range, or a set or a mesh is unknown.
    """
    return _whole_faces(mesh.surface(), where, lambda place: select_vertices(mesh, place))


def _whole_faces(
    faces: NDArray[np.int32], where: Where, choose: Callable[[Where], NDArray[np.integer]]
) -> NDArray[np.int32]:
    """Return the faces (q, c) whose corners are all chosen by one of the united selections of ``where``.

    ``choose`` returns the points of a selection.
    """
    whole = [np.isin(corners_of(faces), choose(place)).all(axis=1) for place in where.places]
    return faces[np.any(whole, axis=0)]


def part_of(mesh: Mesh, name: str) -> MeshPart:
    """Return the mesh with a given name in an assembly, with its pose.

    Raises:
        MeshError: there is no mesh of this name.
    """
    if name in mesh.parts:
        return mesh.parts[name]
    known = f"there are: {', '.join(mesh.parts)}" if mesh.parts else "there is one mesh, which has no name"
    raise MeshError("the selection does not fit the mesh", [f"mesh {name!r} does not exist; {known}"])


def unite(selected: Iterable[NDArray[np.int32]]) -> NDArray[np.int32]:
    """Return the sorted union of several selections."""
    return np.unique(np.concatenate([np.zeros(0, np.int32), *selected])).astype(np.int32)


def at_end(points: NDArray[np.float64], side: Side, slack: float) -> NDArray[np.bool_]:
    """Return whether each point is on a side of the bounding box of all points, within ``slack`` [m]."""
    coordinate = points[:, "xyz".index(side.value[0])]
    if side.value[1] == "-":
        return coordinate <= coordinate.min() + slack
    return coordinate >= coordinate.max() - slack


def inside_of(mesh: Mesh, points: NDArray[np.float64], where: Where) -> NDArray[np.bool_]:
    """Return whether each point lies in a box or sphere, extended by 1e-9 of the mesh size."""
    slack, box = INSIDE_SLACK * mesh.size, where.box
    if box is None:
        return np.linalg.norm(points - where.sphere.center, axis=1) <= where.sphere.radius + slack
    inside = np.ones(len(points), dtype=bool)
    for axis, interval in enumerate((box.x, box.y, box.z)):
        if interval is not None:
            inside &= (points[:, axis] >= interval[0] - slack) & (points[:, axis] <= interval[1] + slack)
    return inside


def _ids(mask: NDArray[np.bool_]) -> NDArray[np.int32]:
    return np.flatnonzero(mask).astype(np.int32)


def _check(ids: tuple[int, ...], count: int, noun: str) -> NDArray[np.int32]:
    wrong = [i for i in ids if not 0 <= i < count]
    if wrong:
        raise MeshError(
            "the selection does not fit the mesh", [f"{noun} ids {wrong[:10]} do not exist; allowed: 0 to {count - 1}"]
        )
    return np.unique(np.asarray(ids, dtype=np.int32))


def select_skin(mesh: Mesh, where: Where) -> NDArray[np.int32]:
    """Return the triangles (t, 3) int32 of a mesh's skin whose three points are selected; there may be none.

    The key ``face`` refers to the bounding box of the skin.

    Raises:
        MeshError: the selection is by ids, sets or the name of a mesh; these refer to cells and not to a skin.
    """
    points = mesh.skin.at(mesh.vertices)
    return _whole_faces(mesh.skin.faces, where, lambda place: _ids(_choose(mesh, points, place)))


def select_touching(mesh: Mesh, where: Where) -> NDArray[np.int32]:
    """Return the sorted indices of the selected contact points of a mesh's skin; there may be none.

    The key ``face`` refers to the bounding box of the skin.

    Raises:
        MeshError: the selection is by ids or sets, which refer to cells and not to a skin, or a mesh is unknown.
    """
    if where.mesh is not None:
        part, first = part_of(mesh, where.mesh).mesh, sum(len(each.corners) for each in _before(mesh, where.mesh))
        return np.zeros(0, np.int32) if part.touching is None else select_touching(part, where.inner) + np.int32(first)
    if where.any is not None:
        return unite(select_touching(mesh, place) for place in where.any)
    points, ends = mesh.touching.at(mesh.vertices), mesh.outside.at(mesh.vertices)
    return _ids(_choose(mesh, np.concatenate([points, ends]), where)[: len(points)])


def select_touching_faces(mesh: Mesh, where: Where) -> NDArray[np.int32]:
    """Return the triangles (t, 3) int32 of contact points whose three points are selected; there may be none.

    In a union, one of the united selections must contain all three.

    Raises:
        MeshError: as for `select_touching`.
    """
    return _whole_faces(mesh.touching.faces, where, lambda place: select_touching(mesh, place))


def _before(mesh: Mesh, name: str) -> list[Touching]:
    """Return the contact points of each mesh that precedes the mesh ``name`` in the assembly."""
    last = part_of(mesh, name).first_vertex
    before = [each.mesh.touching for each in mesh.parts.values() if each.first_vertex < last]
    return [each for each in before if each is not None]


def _choose(mesh: Mesh, points: NDArray[np.float64], where: Where) -> NDArray[np.bool_]:
    """Return whether each of ``points`` (k, 3) [m] of a skin is selected."""
    if where.mesh is None and where.face is not None:
        return at_end(points, where.face, FACE_SLACK * mesh.size)
    if where.mesh is None and (where.box is not None or where.sphere is not None):
        return inside_of(mesh, points, where)
    raise MeshError(
        "the selection does not fit the skin",
        ["ids, sets and names of meshes are those of cells, not of a skin; allowed: face, box, sphere"],
    )

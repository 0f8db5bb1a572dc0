# SPDX-License-Identifier: Apache-2.0
"""Cavities of a mesh: closed inner surfaces that a fluid can fill."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.errors import show_point
from gdfe_ros.mesh.cells.faces import corners_of, enclosed_volume, reverse, vertex_pieces
from gdfe_ros.mesh.cells.tetrahedra import flat_quads, six_node_volume
from gdfe_ros.mesh.mesh import Mesh
from gdfe_ros.mesh.overlap import find_self_cuts
from gdfe_ros.mesh.surfaces.shells import inside, shell_numbers, shells
from gdfe_ros.mesh.surfaces.surface_edges import is_closed

NO_CAVITY = (
    "the body has no closed cavity, so that there is no chamber; if it has air with an inlet, close the inlet, e.g. by "
    "a second solid that touches the body (docs/cad.md)"
)
"""Remark for a body without a cavity, for users who meant to model a chamber."""


@dataclass(frozen=True, eq=False)
class Cavity:
    """A closed surface inside a body.

    Attributes:
        quads: vertex ids, shape (q, 4) or (q, 6), int32, normals out of the cavity, into the material: pressure in
            the cavity pushes along them.
        volume: undeformed volume of the cavity [m^3], > 0.
        center: mean of the surface's vertices [m], shape (3,).
    """

    quads: NDArray[np.int32]
    volume: float
    center: NDArray[np.float64]


def find_cavities(mesh: Mesh) -> list[Cavity]:
    """Return the cavities of a mesh, the largest first.

    The boundary consists of closed pieces. A piece bounds a cavity if its volume in `boundary_pieces` is positive.
    """
    found = []
    for own, volume in boundary_pieces(mesh):
        if volume > 0.0:
            inner = reverse(mesh.boundary.quads[own])
            found.append(Cavity(inner, volume, mesh.vertices[np.unique(inner)].mean(axis=0)))
    return sorted(found, key=lambda cavity: (-cavity.volume, tuple(cavity.center)))


def boundary_pieces(mesh: Mesh) -> Iterator[tuple[NDArray[np.bool_], float]]:
    """Yield a mask (q,) of the faces of each closed piece of the boundary, and the volume [m^3] of the space inside it.

    The volume is positive for a cavity, and negative for an outer boundary of the body.
    """
    quads = mesh.boundary.quads
    piece = surface_pieces(mesh.vertices, corners_of(quads))
    for number in range(int(piece.max(initial=-1)) + 1):
        own = piece == number
        yield own, inside_volume(mesh.vertices, reverse(quads[own]))


def inside_volume(points: NDArray[np.float64], faces: NDArray[np.int32]) -> float:
    """Return the volume [m^3] inside a closed surface of faces (q, 4) or (q, 6), positive for outward normals."""
    return enclosed_volume(points, faces) if faces.shape[1] == 4 else six_node_volume(points, faces)


def skin_cavities(mesh: Mesh) -> list[Cavity]:
    """Return the cavities of a mesh's skin, the largest first.

    A cavity is a closed shell of the skin inside an odd number of other closed shells.
    """
    points, triangles = mesh.skin.at(mesh.vertices), mesh.skin.faces.astype(np.int64)
    number = shell_numbers(len(points), triangles)
    closed = [is_closed(triangles[number == shell]) for shell in range(number.max(initial=-1) + 1)]
    kept = np.array(closed, dtype=bool)[number]
    triangles, number = triangles[kept], number[kept]
    found = []
    for shell, depth in zip(np.unique(number), shells(points, triangles).depths, strict=True):
        own = number == shell
        quads = flat_quads(triangles[own]).astype(np.int32)
        volume = enclosed_volume(points, quads)
        if volume < 0.0:
            quads, volume = quads[:, [2, 1, 0, 0]], -volume
        if depth % 2:
            found.append(Cavity(np.ascontiguousarray(quads), volume, points[np.unique(quads)].mean(axis=0)))
    return sorted(found, key=lambda cavity: (-cavity.volume, tuple(cavity.center)))


def surface_pieces(vertices: NDArray[np.float64], quads: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the number of the connected piece of each quad of an oriented closed surface, shape (q,), int32.

    Two quads with a common edge are connected. If cells touch only along an edge, four or more quads meet there. Then
    the two quads that bound the same gap between the cells are connected, because each gap is a space of its own.

    Args:
        vertices: positions [m], shape (n, 3).
        quads: vertex ids, shape (q, 3 or 4), normals out of the material.
    """
    start, end = quads.ravel(), np.roll(quads, -1, axis=1).ravel()
    key = np.minimum(start, end).astype(np.int64) * (int(quads.max(initial=0)) + 1) + np.maximum(start, end)
    order = np.argsort(key, kind="stable")
    bounds = np.flatnonzero(np.diff(key[order], prepend=-1, append=-1))
    sizes = np.diff(bounds)
    plain = bounds[:-1][sizes == 2]
    pairs = [np.stack([order[plain], order[plain + 1]], axis=1)]
    for first, size in zip(bounds[:-1][sizes > 2], sizes[sizes > 2], strict=True):
        pairs.append(_across_gaps(vertices, quads, order[first : first + size]))
    joined = np.concatenate(pairs) // quads.shape[1]
    return vertex_pieces(joined, len(quads))


def _across_gaps(
    vertices: NDArray[np.float64], quads: NDArray[np.int32], half_edges: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return the pairs (g, 2) of half edges whose quads bound the same gap around an edge.

    Each quad runs along the edge or against it, and the material is on opposite sides of these two kinds of quads. In
    the order of angles around the edge, each gap therefore lies between a quad of one kind and one of the other kind.
    """
    size = quads.shape[1]
    quad, corner = half_edges // size, half_edges % size
    begin, end = quads[quad, corner], quads[quad, (corner + 1) % size]
    low, high = min(begin[0], end[0]), max(begin[0], end[0])
    axis = vertices[high] - vertices[low]
    away = vertices[quads[quad]].mean(axis=1) - vertices[low]
    across = away - np.outer(away @ axis, axis) / (axis @ axis)
    side = np.cross(axis, across[0])
    angle = np.arctan2(across @ side / np.linalg.norm(axis), across @ across[0])
    ring = np.argsort(angle, kind="stable")
    along = (begin == low)[ring]
    following = np.roll(np.arange(len(ring)), -1)
    opens = along & ~along[following]
    return np.stack([half_edges[ring[opens]], half_edges[ring[following[opens]]]], axis=1)


_REMEDY = "allowed: wholly inside of the body's material; remedy: export all surfaces in the same frame and unit"

Surface = tuple[NDArray[np.float64], NDArray[np.int64]]
"""Vertices (n, 3) [m] and triangles (t, 3) of a closed surface."""


def find_misplaced_cavities(
    vertices: NDArray[np.float64], triangles: NDArray[np.int64], cavities: Sequence[Surface]
) -> dict[int, str]:
    """Return a dict from number to defect, for each cavity that is not inside of the body's material.

    A cavity is inside if no other surface cuts or touches it, and a point of each of its shells is inside.

    Args:
        vertices: positions of the body's surface [m], shape (n, 3).
        triangles: vertex ids of the body's closed surface, shape (t, 3).
        cavities: closed surfaces of the air, in the same frame.
    """
    surfaces = [(vertices, triangles), *cavities]
    starts = np.cumsum([0, *(len(points) for points, _ in surfaces)])
    points = np.concatenate([own for own, _ in surfaces])
    joined = np.concatenate([ids + start for (_, ids), start in zip(surfaces, starts[:-1], strict=True)])
    owner = np.repeat(np.arange(len(surfaces)), [len(ids) for _, ids in surfaces])
    cuts = find_self_cuts(points, joined)
    found = {}
    for number, (own, ids) in enumerate(cavities):
        mine = owner == number + 1
        crossed = mine[cuts.cut]
        crossed[crossed] = ~find_self_cuts(own, ids).cut[cuts.cut[mine]]
        if crossed.any():
            text = "the air is partly outside: its surface cuts or touches that of the body or of other air"
            found[number] = f"{text}, e.g. near {show_point(cuts.places[crossed][0])} m; {_REMEDY}"
            continue
        _, first = np.unique(shell_numbers(len(own), ids), return_index=True)
        corners = own[ids[first, 0]]
        outside = corners[~inside(corners, points, joined[~mine])]
        if len(outside):
            text = f"the air is outside of the body's material at {show_point(outside[0])} m"
            found[number] = f"{text}; {_REMEDY}"
    return found


def close_on(faces: NDArray[np.int32], holder: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Close the openings of a surface whose rims lie on rigid sets.

    The open edges on one rigid set are joined to one of their vertices. If a side of a six-node plate is no edge of the
    surface, it is straight, and one of its ends is also its middle node.

    Args:
        faces: vertex ids (q, 4) or (q, 6), oriented.
        holder: (n,) number of the rigid set of each vertex, -1 for vertices in none.

    Returns:
        The closing plates (k, c), faces with repeated nodes; and the open edges (l, 2) that no plate closes, because
        they do not lie on one rigid set or form no loop.
    """
    edges = _open_half_edges(faces)
    ends = holder[edges]
    leaks = (ends != ends[:, :1]).any(axis=1) | (ends[:, 0] < 0)
    plates = [np.zeros((0, faces.shape[1]), np.int32)]
    for number in np.unique(ends[:, 0]) if not leaks.any() else ():
        own = ends[:, 0] == number
        out, into = (np.bincount(edges[own, side], minlength=len(holder)) for side in (0, 1))
        if (out != into).any():
            leaks |= own
        else:
            plates.append(_fan(edges[own], faces.shape[1]))
    return np.concatenate(plates), edges[leaks, :2]


def _open_half_edges(faces: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the directed edges (k, 2 or 3) that no other face runs through in the opposite direction.

    The columns are start, end and, for six-node faces, middle node.
    """
    corners = corners_of(faces)
    edges = [corners.ravel(), np.roll(corners, -1, axis=1).ravel()]
    if faces.shape[1] == 6:
        edges.append(faces[:, 3:].ravel())
    half = np.stack(edges, axis=1)
    _, which = np.unique(np.sort(half[:, :2], axis=1), axis=0, return_inverse=True)
    sign = np.where(half[:, 0] < half[:, 1], 1, -1) * (half[:, 0] != half[:, 1])
    balance = np.bincount(which.ravel(), sign)[which.ravel()]
    found = half[sign * balance > 0]
    first = np.unique(found[:, :2], axis=0, return_index=True)[1]
    return np.ascontiguousarray(found[np.sort(first)], dtype=np.int32)


def _fan(edges: NDArray[np.int32], size: int) -> NDArray[np.int32]:
    """Return the triangles from each of the edges (k, 2 or 3) to the first vertex, as faces with ``size`` nodes."""
    origin = edges[0, 0]
    apart = edges[(edges[:, :2] != origin).all(axis=1)]
    start, end = apart[:, 0], apart[:, 1]
    first = np.full(len(apart), origin, dtype=np.int32)
    if size == 4:
        return np.stack([first, end, start, start], axis=1)
    beside = {int(a if b == origin else b): int(m) for a, b, m in edges if origin in (a, b)}
    sides = [[beside.get(int(vertex), int(origin)) for vertex in vertices] for vertices in (end, start)]
    return np.stack([first, end, start, sides[0], apart[:, 2], sides[1]], axis=1).astype(np.int32)

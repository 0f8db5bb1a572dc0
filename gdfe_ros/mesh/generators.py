# SPDX-License-Identifier: Apache-2.0
"""Meshes generated from a few parameters: bars, grids, plates, tubes, rings and hollow spheres."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh.assembly import join, keep_cells, merge_vertices
from gdfe_ros.mesh.mesh import HexMesh
from gdfe_ros.mesh.selection import Where, select_cells


def bar(size: Sequence[float], cells: Sequence[int]) -> HexMesh:
    """Mesh a straight bar along x that starts at x = 0 and is centred on y = z = 0.

    Args:
        size: length, width, height [m], each > 0.
        cells: number of cells (nx, ny, nz) along each axis, each >= 1.

    Returns:
        The mesh; vertex (i, j, k) has the index i + (nx+1) * (j + (ny+1) * k), cell (i, j, k) the index
        i + nx * (j + ny * k).

    Example:
        >>> bar([0.5, 0.05, 0.05], [50, 5, 5]).n_cells
        1250
    """
    lower = np.array([0.0, -0.5, -0.5]) * size
    axes = (low + length * np.arange(n + 1) / n for low, length, n in zip(lower, size, cells, strict=True))
    return grid(*axes)


def grid(x: ArrayLike, y: ArrayLike, z: ArrayLike) -> HexMesh:
    """Mesh a block divided into cells by planes perpendicular to x, y and z; numbered as in `bar`.

    Args:
        x: coordinates of the planes perpendicular to x [m], strictly ascending, at least two.
        y: coordinates of the planes perpendicular to y [m], likewise.
        z: coordinates of the planes perpendicular to z [m], likewise.

    Raises:
        MeshError: an axis has fewer than two planes, or planes that are not finite or not strictly ascending.
    """
    defects = [
        f"grid.{name} = {list(planes)!r}: allowed: two or more planes, strictly ascending [m]"
        for name, planes in {"x": x, "y": y, "z": z}.items()
        if len(planes) < 2 or not np.all(np.diff(planes) > 0)
    ]
    if defects:
        raise MeshError("cannot mesh this grid", defects)
    across_z, across_y, across_x = np.meshgrid(z, y, x, indexing="ij")
    vertices = np.stack([across_x.ravel(), across_y.ravel(), across_z.ravel()], axis=1)
    first = np.arange(len(vertices)).reshape(across_x.shape)[:-1, :-1, :-1].ravel()
    bottom = np.array([0, 1, 1 + len(x), len(x)])
    return HexMesh(vertices, first[:, None] + np.concatenate([bottom, bottom + len(x) * len(y)]))


def cut(mesh: HexMesh, holes: Sequence[Where]) -> HexMesh:
    """Remove cells from a mesh: a cavity, a notch, a window.

    Args:
        mesh: the mesh.
        holes: selections of the cells to remove; boxes and spheres select cells by their centroids.

    Raises:
        MeshError: a hole selects no cell (the error names all such holes), or no cell is left.
    """
    keep = np.ones(mesh.n_cells, dtype=bool)
    defects = []
    for i, hole in enumerate(holes):
        cells = select_cells(mesh, hole)
        keep[cells] = False
        if len(cells) == 0:
            defects.append(f"cut {i} ({hole.chosen[1]}) removes no cell: no cell has its centroid there")
    if not keep.any():
        defects.append("the cuts leave no cell")
    if defects:
        raise MeshError("cannot cut this mesh", defects)
    return keep_cells(mesh, keep)


def finger(size: Sequence[float], *, joints: int, gap: float, web: float, cell: float, taper: float = 1.0) -> HexMesh:
    """Mesh a finger: a bar along x with notches in its lower side, from x = 0, centred on y = z = 0.

    Args:
        size: length, width, height at the base [m].
        joints: number of notches, evenly spaced, so that there are joints + 1 links.
        gap: width of each notch along x [m].
        web: height of the material left above each notch [m].
        cell: largest edge of a cell [m].
        taper: width and height at the tip divided by width and height at the base, in (0, 1].

    Returns:
        The mesh with the cell sets links and joints (the webs) and the vertex sets base and tip (the ends).

    Raises:
        MeshError: the gaps do not fit into the length, or the web into the height.
    """
    length, width, height = size
    link = (length - joints * gap) / (joints + 1)
    defects = []
    if link <= 0:
        defects.append(f"finger.gap = {gap!r}: allowed: {joints} gaps shorter than the length {length:g}")
    if web >= height:
        defects.append(f"finger.web = {web!r}: allowed: less than the height {height:g}")
    if defects:
        raise MeshError("cannot mesh this finger", defects)
    x = _planes(np.cumsum([0.0, *([link, gap] * joints), link]), cell)
    z = _planes(np.array([-height / 2, height / 2 - web, height / 2]), cell)
    block = grid(x, _planes(np.array([-width / 2, width / 2]), cell), z)
    in_gap = block.centroids[:, 0] % (link + gap) > link
    above = block.centroids[:, 2] > height / 2 - web
    sets = {"links": np.flatnonzero(~in_gap), "joints": np.flatnonzero(in_gap & above)}
    ends = {"base": block.vertices[:, 0] == x[0], "tip": block.vertices[:, 0] == x[-1]}
    vertices = block.vertices * 1.0
    vertices[:, 1:] *= (1 - (1 - taper) * vertices[:, :1] / length) if taper < 1 else 1.0
    mesh = HexMesh(vertices, block.cells, sets, {name: np.flatnonzero(mask) for name, mask in ends.items()})
    return keep_cells(mesh, ~in_gap | above)


def _planes(borders: NDArray[np.float64], cell: float) -> NDArray[np.float64]:
    """Return ascending coordinates of planes [m], at most ``cell`` apart: the borders, and planes between borders."""
    pieces = [borders[:1]]
    for low, high in pairwise(borders):
        count = max(1, int(np.ceil((high - low) / cell - 1e-9)))
        pieces.append(np.linspace(low, high, count + 1)[1:])
    return np.concatenate(pieces)


Map = Callable[[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]], tuple[ArrayLike, ...]]

#: Half the side of the square in the middle of a cap, as a fraction of the inner radius.
_CORE = 0.55


def tube(
    inner: float, outer: float, length: float, cells: Sequence[int], *, cap: float = 0.0, cap_cells: int = 1
) -> HexMesh:
    """Mesh a tube along the x axis from x = 0; with caps it encloses a chamber.

    Args:
        inner: inner radius [m], > 0.
        outer: outer radius [m], > inner.
        length: total length [m], caps included.
        cells: number of cells (through the wall, around, along between the caps), each >= 1, around >= 3.
        cap: thickness of the wall at each end [m]; 0 leaves the ends open. With caps the cells around must be
            a multiple of 4.
        cap_cells: number of cells through each cap.

    Returns:
        The mesh with the vertex sets inner (between the caps), outer, start (x = 0) and end (x = length).

    Raises:
        MeshError: arguments do not fit each other; the error names all of them.
    """
    radial, around, along = cells
    defects = [] if outer > inner else [f"tube.outer = {outer!r}: allowed: more than inner = {inner!r}"]
    defects += _around_defects("tube", around, 4 if cap else 1)
    if not 0 <= cap < length / 2:
        defects.append(f"tube.cap = {cap!r}: allowed: 0 to less than half the length, {length / 2:g}")
    if defects:
        raise MeshError("cannot mesh this tube", defects)
    angles = _full_turn(around)
    ends = [np.linspace(0, cap, cap_cells + 1)] * bool(cap)
    middle = np.linspace(cap, length - cap, along + 1)
    planes = np.unique(np.concatenate([*ends, middle, *(length - end[::-1] for end in ends)]))
    wall = grid(np.linspace(inner, outer, radial + 1), angles, planes)
    pieces = [_map(wall, lambda r, turn, x: (x, r * np.cos(turn), r * np.sin(turn)))]
    for end in ends:
        pieces += [_plug(inner, around, end), _plug(inner, around, length - end[::-1])]
    mesh = merge_vertices(join(*pieces))
    x, radius = mesh.vertices[:, 0], np.hypot(mesh.vertices[:, 1], mesh.vertices[:, 2])
    between = (x > cap - 1e-9 * length) & (x < length - cap + 1e-9 * length)
    return _with_sets(
        mesh, inner=between & _near(radius, inner), outer=_near(radius, outer), start=x == 0.0, end=_near(x, length)
    )


def ring(radius: float, section: Sequence[float], cells: Sequence[int], *, angle: float = 360.0) -> HexMesh:
    """Mesh a ring, or an arc of a ring, with a rectangular section, about the z axis.

    Args:
        radius: mean radius [m].
        section: width along the radius and height along z [m]; the width is less than twice the radius.
        cells: number of cells (across the width, around, along the height); around >= 3 for a full ring.
        angle: angle of the arc [degrees] from the x axis towards y, in (0, 360].

    Returns:
        The mesh with the vertex sets inner and outer; an arc also has the vertex sets start and end.

    Raises:
        MeshError: arguments do not fit each other; the error names all of them.
    """
    full = angle == 360.0
    defects = _around_defects("ring", cells[1], 1) if full else []
    if section[0] >= 2 * radius:
        defects.append(f"ring.section = {section!r}: allowed: width less than twice the radius, {2 * radius:g}")
    if defects:
        raise MeshError("cannot mesh this ring", defects)
    low, high = radius - section[0] / 2, radius + section[0] / 2
    angles = _full_turn(cells[1]) if full else np.linspace(0, np.radians(angle), cells[1] + 1)
    flat = grid(
        np.linspace(low, high, cells[0] + 1), angles, np.linspace(-section[1] / 2, section[1] / 2, cells[2] + 1)
    )
    r, turn, _ = flat.vertices.T
    sets = {"inner": r == r.min(), "outer": r == r.max()}
    if not full:
        sets |= {"start": turn == 0, "end": turn == angles[-1]}
    mesh = _with_sets(_map(flat, lambda r, turn, z: (r * np.cos(turn), r * np.sin(turn), z)), **sets)
    return merge_vertices(mesh) if full else mesh


def sphere(inner: float, outer: float, cells: Sequence[int]) -> HexMesh:
    """Mesh a hollow sphere about the origin.

    The six faces of a cube are divided at equal angles and mapped to the sphere.

    Args:
        inner: inner radius [m], > 0.
        outer: outer radius [m], > inner.
        cells: number of cells (along each edge of the cube, through the wall).

    Returns:
        The mesh with the vertex sets inner and outer; it encloses one cavity.

    Raises:
        MeshError: arguments do not fit each other; the error names all of them.
    """
    if outer <= inner:
        raise MeshError("cannot mesh this sphere", [f"sphere.outer = {outer!r}: allowed: more than {inner!r}"])
    angles = np.linspace(-np.pi / 4, np.pi / 4, cells[0] + 1)
    face = _map(grid(angles, angles, np.linspace(inner, outer, cells[1] + 1)), _blow_up)
    faces = []
    for axes in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        turned = face.vertices[:, axes]
        faces += [HexMesh(turned, face.cells), HexMesh(-turned, face.cells[:, [3, 2, 1, 0, 7, 6, 5, 4]])]
    mesh = merge_vertices(join(*faces))
    radius = np.linalg.norm(mesh.vertices, axis=1)
    return _with_sets(mesh, inner=_near(radius, inner), outer=_near(radius, outer))


def _plug(radius: float, around: int, planes: NDArray[np.float64]) -> HexMesh:
    """Mesh a solid cylinder along x: a square core, and a ring around it with ``around`` cells at its rim."""
    side = around // 4
    core = np.tan(np.linspace(-np.pi / 4, np.pi / 4, side + 1)) * _CORE * radius
    square = _map(grid(core, core, planes), lambda y, z, x: (x, y, z))
    rows = np.linspace(0, 1, max(1, around // 8) + 1)

    def between(share: NDArray, turn: NDArray, x: NDArray) -> tuple[ArrayLike, ...]:
        y, z = np.cos(turn), np.sin(turn)
        reach = (1 - share) * _CORE / np.maximum(abs(y), abs(z)) + share
        return x, radius * reach * y, radius * reach * z

    return join(square, _map(grid(rows, _full_turn(around), planes), between))


def _full_turn(around: int) -> NDArray[np.float64]:
    """Return ``around`` + 1 equally spaced angles [rad] of a full circle, from -45 deg (a corner of `_plug`'s core)."""
    return np.linspace(-np.pi / 4, 7 * np.pi / 4, around + 1)


def _blow_up(u: NDArray, v: NDArray, r: NDArray) -> tuple[ArrayLike, ...]:
    x, y = np.tan(u), np.tan(v)
    scale = r / np.sqrt(x**2 + y**2 + 1)
    return scale * x, scale * y, scale


def _map(mesh: HexMesh, mapping: Map) -> HexMesh:
    return HexMesh(np.stack(np.broadcast_arrays(*mapping(*mesh.vertices.T)), axis=1), mesh.cells)


def _with_sets(mesh: HexMesh, **masks: NDArray[np.bool_]) -> HexMesh:
    sets = {name: np.flatnonzero(mask) for name, mask in masks.items()}
    return HexMesh(mesh.vertices, mesh.cells, mesh.cell_sets, sets)


def _near(values: NDArray[np.float64], value: float) -> NDArray[np.bool_]:
    return np.isclose(values, value, rtol=1e-9, atol=0.0)


def _around_defects(where: str, around: int, multiple: int) -> list[str]:
    if around >= 3 and around % multiple == 0:
        return []
    form = f" that are a multiple of {multiple}" if multiple > 1 else ""
    return [f"{where}.cells = {around} around: allowed: 3 or more{form}"]

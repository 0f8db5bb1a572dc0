# SPDX-License-Identifier: Apache-2.0
"""Round bodies: tube, ring and hollow sphere."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh.assembly import join, merge_vertices
from gdfe_ros.mesh.generators import grid
from gdfe_ros.mesh.mesh import HexMesh

Map = Callable[[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]], tuple[ArrayLike, ...]]

#: Half the side of the square in the middle of a cap, as a fraction of the inner radius.
_CORE = 0.55


def tube(
    inner: float, outer: float, length: float, cells: Sequence[int], *, cap: float = 0.0, cap_cells: int = 1
) -> HexMesh:
    """Mesh a tube along x with its axis at y = z = 0, from x = 0; with caps it encloses a chamber.

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
    pieces = [_mapped(grid(np.linspace(inner, outer, radial + 1), angles, planes), _along_x)]
    for end in ends:
        pieces += [_plug(inner, around, end), _plug(inner, around, length - end[::-1])]
    mesh = merge_vertices(join(*pieces))
    x, radius = mesh.vertices[:, 0], np.hypot(mesh.vertices[:, 1], mesh.vertices[:, 2])
    between = (x > cap - 1e-9 * length) & (x < length - cap + 1e-9 * length)
    return _with_sets(
        mesh,
        inner=between & _near(radius, inner),
        outer=_near(radius, outer),
        start=x == 0.0,
        end=_near(x, length),
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
        np.linspace(low, high, cells[0] + 1),
        angles,
        np.linspace(-section[1] / 2, section[1] / 2, cells[2] + 1),
    )
    r, turn, _ = flat.vertices.T
    sets = {"inner": r == r.min(), "outer": r == r.max()}
    if not full:
        sets |= {"start": turn == 0, "end": turn == angles[-1]}
    mesh = _with_sets(_mapped(flat, lambda r, turn, z: (r * np.cos(turn), r * np.sin(turn), z)), **sets)
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
    face = _mapped(grid(angles, angles, np.linspace(inner, outer, cells[1] + 1)), _blown_up)
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
    square = _mapped(grid(core, core, planes), lambda y, z, x: (x, y, z))
    rows = np.linspace(0, 1, max(1, around // 8) + 1)

    def between(share: NDArray, turn: NDArray, x: NDArray) -> tuple[ArrayLike, ...]:
        y, z = np.cos(turn), np.sin(turn)
        reach = (1 - share) * _CORE / np.maximum(abs(y), abs(z)) + share
        return x, radius * reach * y, radius * reach * z

    return join(square, _mapped(grid(rows, _full_turn(around), planes), between))


def _full_turn(around: int) -> NDArray[np.float64]:
    """Return ``around`` + 1 equally spaced angles [rad] of a full circle, from -45 degrees (a square's corner)."""
    return np.linspace(-np.pi / 4, 7 * np.pi / 4, around + 1)


def _along_x(r: NDArray, turn: NDArray, x: NDArray) -> tuple[ArrayLike, ...]:
    return x, r * np.cos(turn), r * np.sin(turn)


def _blown_up(u: NDArray, v: NDArray, r: NDArray) -> tuple[ArrayLike, ...]:
    x, y = np.tan(u), np.tan(v)
    scale = r / np.sqrt(x**2 + y**2 + 1)
    return scale * x, scale * y, scale


def _mapped(mesh: HexMesh, mapping: Map) -> HexMesh:
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

# SPDX-License-Identifier: Apache-2.0
"""Meshes of cubes inside closed surfaces, with their cavities.

The mesh has whole cubes whose centres are inside, or cut cubes with the volume, centroid and second moments of the
material in them.
"""

from __future__ import annotations

import math
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from enum import Enum
from importlib import import_module
from io import StringIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.errors import MeshError, show_point
from gdfe_ros.mesh.assembly import keep_cells
from gdfe_ros.mesh.cavities import find_cavities
from gdfe_ros.mesh.cells.filling import Filling
from gdfe_ros.mesh.files.mesh_input import require_file, unit_defects
from gdfe_ros.mesh.generators import grid
from gdfe_ros.mesh.mesh import HexMesh
from gdfe_ros.mesh.surfaces.shells import Shells, points_inside, shells
from gdfe_ros.mesh.surfaces.surface_edges import odd_edges

#: Number of columns through a cube along an axis, and the generator of their Fibonacci lattice. Along a column the
#: integrals are exact. No two columns share a coordinate, so that a wall parallel to the columns that moves through the
#: cube passes them one by one.
COLUMNS, LATTICE = 144, 89
#: Filled fraction below which a cube does not become a cell: its material moves to the fullest neighbouring cell.
LEAST_SHARE = 0.1
#: Difference of the filled fraction from 0 or 1 below which a cube counts as empty or whole.
EXACT = 1e-9


def cube_moments(
    vertices: NDArray[np.float64], triangles: NDArray[np.int64], count: tuple[int, int, int]
) -> NDArray[np.float64]:
    """Return the moments of the material inside a closed surface, for each cube of a grid.

    Args:
        vertices: positions in units of the cubes' edge, from the grid's first corner, shape (n, 3).
        triangles: vertex ids of a closed surface, shape (t, 3).
        count: number of cubes along each axis.

    Returns:
        Moments (cubes, 7), x fastest: integrals of 1, xi, eta, zeta, xi^2, eta^2, zeta^2 over the material, divided by
        the volume of the whole cube. The reference coordinates xi, eta, zeta are -1 .. 1 in the cube.
    """
    directions = [_along(vertices, triangles, count, axis) for axis in range(3)]
    moments, crossed = (np.stack(part) for part in zip(*directions, strict=True))
    moments = np.take_along_axis(moments, crossed.argmax(axis=0)[None, :, None], axis=0)[0]
    whole = np.abs(moments[:, 0] - 1.0) < EXACT
    moments[whole] = [1.0, 0.0, 0.0, 0.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0]
    moments[moments[:, 0] < EXACT] = 0.0
    return moments


def _along(
    vertices: NDArray[np.float64], triangles: NDArray[np.int64], count: tuple[int, int, int], axis: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Integrate along columns parallel to an axis; return moments (cubes, 7) and the number of crossings in each cube.

    A crossing is an intersection of a column with the surface. Columns resolve the surface exactly along their axis.
    The axis with most crossings is closest to the surface's normal.
    """
    from gdfe_ros.mesh.surfaces.cell_kernels import integrate_columns  # scenes without cut cells load without numba

    turn = [(axis + 1) % 3, (axis + 2) % 3, axis]
    size = tuple(count[i] for i in turn)
    moments = np.zeros((8, np.prod(size)))
    number = np.arange(COLUMNS)
    places = np.column_stack([number + 0.5, number * LATTICE % COLUMNS + 0.5]) / COLUMNS
    integrate_columns(np.ascontiguousarray(vertices[:, turn]), triangles.astype(np.int64), places, size, moments)
    back = [turn.index(i) for i in range(3)]
    rows = [0, *(1 + i for i in back), *(4 + i for i in back), 7]
    grid = moments[rows].reshape(8, *size[::-1]).transpose(0, *(3 - back[i] for i in (2, 1, 0)))
    grid = grid.reshape(8, -1).T
    return grid[:, :7] / COLUMNS, grid[:, 7]


def gather_slivers(moments: NDArray[np.float64], count: tuple[int, int, int]) -> NDArray[np.float64]:
    """Move the material of slivers (nearly empty cubes) to neighbouring cells; return the new moments (cubes, 7).

    The receiving cell is the fullest cell that shares a face with the sliver. If slivers were cells, some of their
    corners would have a millionth of a cell's stiffness. If their material were dropped, the error would be of first
    order. The moved material follows the extrapolated displacement field of the receiving cell. A sliver without a
    neighbouring cell is dropped.
    """
    nx, ny, nz = count
    gathered = moments.copy()
    share = moments[:, 0].reshape(nz, ny, nx)
    slivers = np.argwhere((share > 0.0) & (share < LEAST_SHARE))
    best, owner, away = np.zeros(len(slivers)), np.full(len(slivers), -1), np.zeros((len(slivers), 3))
    for axis in range(3):
        for side in (-1, 1):
            beside = slivers.copy()
            beside[:, axis] += side
            there = (beside[:, axis] >= 0) & (beside[:, axis] < share.shape[axis])
            beside[~there] = 0
            full = np.where(there, share[tuple(beside.T)], 0.0)
            better = (full >= LEAST_SHARE) & (full > best)
            best[better] = full[better]
            owner[better] = np.ravel_multi_index(tuple(beside[better].T), share.shape)
            away[better] = 0.0
            away[better, 2 - axis] = -2.0 * side
    sliver, taken = np.ravel_multi_index(tuple(slivers.T), share.shape), owner >= 0
    own = moments[sliver]
    first = own[:, 1:4] + away * own[:, :1]
    second = own[:, 4:] + 2.0 * away * own[:, 1:4] + away**2 * own[:, :1]
    np.add.at(gathered, owner[taken], np.column_stack([own[:, 0], first, second])[taken])
    gathered[sliver] = 0.0
    return gathered


#: Suffixes of surface files.
SUFFIXES = (".stl", ".obj", ".ply", ".off")
#: Limit of cubes in the bounding box; more would not fit into memory.
MOST_CUBES = 50_000_000
#: The grid is too coarse if the volumes of the cubes and of the surface differ by more than this fraction.
VOLUME_ERROR = 0.3
#: Vertices of a surface are merged if they agree in this number of digits of the body's longest side. Single precision
#: has seven digits.
MERGED_DIGITS = 8
#: Limits of a body's longest side in the file's unit, whatever the unit is.
SMALLEST, LARGEST = 1e-12, 1e12

_STL_HEAD, _STL_FACE = 84, 50
"""Sizes of the header of a binary STL file, and of each triangle [bytes]. The last four bytes of the header are the
number of triangles.
"""


class CutCubes(str, Enum):
    """Treatment of the cubes that a surface cuts: whole cubes, or cut cubes with their filled fraction."""

    WHOLE = "whole"
    CUT = "cut"


def read_voxels(
    surface: str | Path, *, cell: float, scale: float | None = None, cells: CutCubes = CutCubes.WHOLE
) -> HexMesh:
    """Fill a closed surface with cubes.

    Args:
        surface: an STL, OBJ, PLY or OFF file; nested shells are cavities, whatever their orientation.
        cell: edge of the cubes [m].
        scale: metres for each unit of the file, e.g. 0.001 for millimetres; None assumes metres and rejects bodies of
            implausible size.
        cells: WHOLE for whole cubes whose centres are inside, CUT for cut cubes with their filled fraction.

    Returns:
        The mesh. Its grid is centred on the bounding box of the surface; x is the fastest index of vertices and cells.

    Raises:
        MeshError: the surface has defects; the error names every defect and its remedy.
    """
    return fill_surface(*read_surface(surface, scale=scale), cell=cell, cells=cells, where=f"surface {surface}")


def read_surface(
    surface: str | Path, *, scale: float | None = None, closed: bool = True
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return vertices (n, 3) [m] and triangles (t, 3) of a surface file; the arguments are those of `examine_surface`.

    Raises:
        MeshError: the surface has defects; the error names every defect and its remedy.
    """
    vertices, triangles, defects = examine_surface(surface, scale=scale, closed=closed)
    if defects:
        raise MeshError(f"surface {surface}", defects)
    return vertices, triangles


def examine_surface(
    surface: str | Path, *, scale: float | None = None, closed: bool = True, suffixes: tuple[str, ...] = SUFFIXES
) -> tuple[NDArray[np.float64], NDArray[np.int64], list[str]]:
    """Read a surface file, and examine whether the surface can be filled.

    Args:
        surface: the file.
        scale: metres for each unit of the file; None assumes metres and rejects implausible sizes.
        closed: whether an open surface is a defect.
        suffixes: suffixes of allowed files.

    Returns:
        Vertices [m], shape (n, 3); triangles, shape (t, 3); and the defects.

    Raises:
        MeshError: the file has no usable surface; the error names the reason.
    """
    path = Path(surface)
    vertices, triangles = _read(path, f"surface {path}", suffixes)
    defects = unit_defects(math.hypot(*np.ptp(vertices, axis=0)), scale)
    defects += _open_edges(vertices, triangles) if closed else []
    return vertices * (scale or 1.0), triangles, defects


def fill_surface(
    vertices: NDArray[np.float64],
    triangles: NDArray[np.int64],
    *,
    cell: float,
    cells: CutCubes = CutCubes.WHOLE,
    where: str = "surface",
) -> HexMesh:
    """Fill a closed surface with cubes; inside and outside follow from the even-odd rule.

    Args:
        vertices: positions [m], shape (n, 3).
        triangles: vertex ids of a closed surface, shape (t, 3).
        cell: edge of the cubes [m].
        cells: WHOLE for whole cubes whose centres are inside, CUT for cut cubes with their filled fraction.
        where: name of the surface in an error.

    Raises:
        MeshError: the number of cubes is too large, or the grid is too coarse.
    """
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    count = np.maximum(np.ceil((high - low) / cell - 1e-6), 1)
    if count.prod() > MOST_CUBES:
        fitting = cell * (count.prod() / MOST_CUBES) ** (1 / 3)
        text = f"cell = {cell:g} m gives {count.prod():.3g} cubes; allowed: up to {MOST_CUBES:.3g}"
        raise MeshError(where, [f"{text}; remedy: a cell of at least {fitting:.2g} m"])
    nx, ny, nz = count.astype(int)
    start = (low + high - count * cell) / 2
    axes = (origin + cell * np.arange(n + 1) for origin, n in zip(start, (nx, ny, nz), strict=True))
    if cells is CutCubes.CUT:
        moments = gather_slivers(cube_moments((vertices - start) / cell, triangles, (nx, ny, nz)), (nx, ny, nz))
        kept = moments[:, 0] > 0.0
        mesh = replace(keep_cells(grid(*axes), kept), filling=Filling.of_moments(moments[kept]))
    else:
        inside = points_inside((vertices - start) / cell - 0.5, triangles, (nx, ny, nz))
        mesh = keep_cells(grid(*axes), inside.transpose(2, 1, 0).ravel())
    defects = _too_coarse(mesh, shells(vertices, triangles), cell)
    if defects:
        raise MeshError(where, defects)
    return mesh


def _read(path: Path, heading: str, suffixes: tuple[str, ...]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    try:
        library = import_module("trimesh")
    except ImportError as error:
        raise MeshError(heading, ["trimesh is not installed; remedy: pip install 'gdfe_ros[mesh]'"]) from error
    require_file(path, heading, suffixes=suffixes)
    try:
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()), np.errstate(all="ignore"):
            surface = library.load(path, force="mesh", process=False)
    except ImportError as error:  # trimesh does not name pycollada
        wanted = error.name or "'gdfe_ros[arm]'"
        text = f"cannot be read as {path.suffix}: {error}; remedy: pip install {wanted}"
        raise MeshError(heading, [text]) from error
    except Exception as error:  # trimesh's parsers raise anything on a broken file
        reason = _broken_stl(path) or "its content does not fit its kind"
        raise MeshError(heading, [f"cannot be read as {path.suffix}: {reason}; remedy: export it again"]) from error
    if len(surface.faces) == 0 and (reason := _broken_stl(path)):
        raise MeshError(heading, [f"cannot be read as {path.suffix}: {reason}; remedy: export it again"])
    if len(surface.faces) == 0:
        raise MeshError(heading, ["there are no triangles; remedy: export the body's surface"])
    if defects := _not_finite(np.asarray(surface.vertices), np.asarray(surface.faces)):
        raise MeshError(heading, defects)
    longest = float(surface.extents.max())
    if not SMALLEST <= longest <= LARGEST:
        text = f"the body's longest side is {longest:g} in the file's unit; allowed in any unit: {SMALLEST:g} to"
        raise MeshError(heading, [f"{text} {LARGEST:g}; remedy: export it in a usual unit, e.g. in millimetres"])
    digits = MERGED_DIGITS - math.ceil(math.log10(longest))
    surface.merge_vertices(merge_tex=True, merge_norm=True, digits_vertex=digits)
    triangles = np.asarray(surface.faces)
    whole = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    return np.asarray(surface.vertices, dtype=np.float64), triangles[whole]


def _broken_stl(path: Path) -> str:
    """Return a text if the size of a binary STL file differs from that in its header; empty otherwise."""
    content = path.read_bytes()
    if path.suffix.lower() != ".stl" or len(content) < _STL_HEAD:
        return ""
    stated, found = int.from_bytes(content[_STL_HEAD - 4 : _STL_HEAD], "little"), (len(content) - _STL_HEAD) / _STL_FACE
    if content.lstrip().startswith(b"solid") and b"facet" in content:
        return ""
    return f"its header states {stated} triangles, but the file has the size of {found:g}" if stated != found else ""


def _not_finite(vertices: NDArray[np.float64], triangles: NDArray[np.int64]) -> list[str]:
    """Return a list with a defect that names the first coordinate that is NaN or infinite; empty if there is none."""
    wrong = np.argwhere(~np.isfinite(vertices))
    if len(wrong) == 0:
        return []
    vertex, axis = wrong[0]
    users = np.flatnonzero((triangles == vertex).any(axis=1))
    place = f"vertex {vertex}" + (f" (in triangle {users[0]})" if len(users) else "")
    return [
        f"{len(wrong)} coordinates are not finite, the first: {'xyz'[axis]} = {vertices[vertex, axis]:g} of {place}, "
        "counted from 0; allowed: finite numbers; remedy: export it again"
    ]


def _open_edges(vertices: NDArray[np.float64], triangles: NDArray[np.int64]) -> list[str]:
    odd = odd_edges(triangles)
    if len(odd) == 0:
        return []
    return [
        f"the surface is open: {len(odd)} edges belong to an odd number of triangles, the first at "
        f"{show_point(vertices[odd[0]].mean(axis=0))} in the file's unit; remedy: close the holes (MeshLab: "
        "Close Holes, Blender: 3D-Print toolbox) or export it as a solid"
    ]


def _too_coarse(mesh: HexMesh, surface: Shells, cell: float) -> list[str]:
    remedy = "remedy: a smaller cell, at most half the thinnest wall"
    if mesh.n_cells == 0:
        return [f"cell = {cell:g} m: no cube's centre lies inside the surface; {remedy}"]
    filled = mesh.n_cells if mesh.filling is None else mesh.filling.share.sum()
    share = filled * cell**3 / surface.volume
    defects = []
    if abs(share - 1) > VOLUME_ERROR:
        defects.append(f"cell = {cell:g} m: the cubes have {share:.0%} of the surface's volume; {remedy}")
    kept = len(find_cavities(mesh))
    if kept < surface.n_cavities:
        defects.append(f"cell = {cell:g} m: of {surface.n_cavities} cavities {kept} are left; {remedy}")
    return defects

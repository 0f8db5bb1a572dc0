# SPDX-License-Identifier: Apache-2.0
"""Import of hexahedra or tetrahedra from files: Gmsh, VTK, Abaqus and other formats."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh.assembly import keep_cells, merge_vertices
from gdfe_ros.mesh.mesh import HexMesh, Mesh
from gdfe_ros.mesh.mesh_file import read_file
from gdfe_ros.mesh.mesh_input import unit_defects
from gdfe_ros.mesh.quality import check_mesh, list_ids
from gdfe_ros.mesh.raw_mesh import CellBlock, RawMesh, named_sets
from gdfe_ros.mesh.tetmesh import TetMesh, raised

_FILL = "fill its surface with `mesh: {tets: {surface: FILE.stl, size: SIZE}}`"
_TETRAHEDRA = ("tetra", "tetra10")
"""Names of tetrahedra of first and of second order."""
#: Dict from the first letters of the name of a solid cell type to the remedy for cells that are not supported.
_REMEDIES = {
    "hexahedron": "mesh it in first order (Gmsh: -order 1, Abaqus: C3D8), or give `first_order: true`",
    "tetra": "mesh it with tetrahedra of first or second order (4 or 10 nodes)",
    "wedge": f"mesh it with tetrahedra or hexahedra only, or {_FILL}",
    "pyramid": f"mesh it with tetrahedra or hexahedra only, or {_FILL}",
    "polyhedron": f"mesh it with tetrahedra or hexahedra only, or {_FILL}",
}


def read_mesh(path: str | Path, *, scale: float | None = None, merge: bool = False, first_order: bool = False) -> Mesh:
    """Read a mesh of hexahedra, or of tetrahedra of first or second order.

    Tetrahedra of first order get a node in the middle of each edge (`TetMesh.linear`).

    Physical groups, element sets and whole-number cell data become `cell_sets`; node sets and groups of
    faces, edges or points become `vertex_sets`. Vertices that no cell uses are dropped, and the others are numbered
    in the order of the file.

    Args:
        path: a file of Gmsh, VTK or Abaqus, or of another kind that meshio reads.
        scale: metres for each unit of the file, e.g. 0.001 for millimetres; None assumes metres and rejects
            bodies of implausible size.
        merge: whether to merge vertices at the same place.
        first_order: whether to reduce second-order hexahedra to their eight corners.

    Raises:
        MeshError: the file has defects; the error names every defect and its remedy.
    """
    mesh, defects = examine_mesh(path, scale=scale, merge=merge, first_order=first_order)
    if defects:
        raise MeshError(f"mesh {path}", defects)
    return mesh


def examine_mesh(
    path: str | Path, *, scale: float | None = None, merge: bool = False, first_order: bool = False
) -> tuple[Mesh, list[str]]:
    """Read a mesh like `read_mesh`, and return it with its defects; the list is empty for a sound mesh.

    Raises:
        MeshError: the file has no usable mesh; the error names every reason.
    """
    path = Path(path)
    heading = f"mesh {path}"
    raw = read_file(path, heading)
    defects = _unsuited(raw, first_order)
    if defects:
        raise MeshError(heading, defects)
    mesh = _solid_mesh(raw, heading)
    if not np.isfinite(mesh.vertices).all():
        return mesh, check_mesh(mesh).defects
    mesh = keep_cells(mesh, np.ones(mesh.n_cells, dtype=bool))
    defects = unit_defects(mesh.size, scale)
    mesh = replace(mesh, vertices=mesh.vertices * (scale or 1.0), remarks=tuple(raw.remarks))
    if merge:
        mesh = merge_vertices(mesh)
    return mesh, defects + check_mesh(mesh).defects


def _counts(raw: RawMesh, kinds: tuple[str, ...] = ()) -> dict[str, int]:
    """Return a dict from kind of cell to number of cells, of all kinds or only of the given ``kinds``."""
    counts: dict[str, int] = {}
    for block in raw.cells:
        if len(block.data) and (not kinds or block.type in kinds):
            counts[block.type] = counts.get(block.type, 0) + len(block.data)
    return counts


def _unsuited(raw: RawMesh, first_order: bool) -> list[str]:
    """Return a line of text for each reason why a file gives no mesh."""
    return [*_wrong_kinds(raw, first_order), *_nothing_solid(raw), *_damaged(raw)]


def _wrong_kinds(raw: RawMesh, first_order: bool) -> Iterator[str]:
    """Yield a line for each kind of cell that cannot be used, and a line for kinds that cannot be used together."""
    solid = {kind: n for kind, n in _counts(raw).items() if _remedy(kind)}
    tets, hexes = _counts(raw, _TETRAHEDRA), [kind for kind in solid if kind.startswith("hexahedron")]
    sound = {*_TETRAHEDRA, "hexahedron", *(hexes if first_order else ())}
    for kind in (kind for kind in solid if kind not in sound):
        allowed = "8-vertex hexahedra, or tetrahedra with 4 or 10 nodes"
        yield f"{solid[kind]} cells of the kind {kind}; allowed: {allowed}; remedy: {_remedy(kind)}"
    if tets and (len(tets) > 1 or hexes):
        found = ", ".join(f"{n} {kind}" for kind, n in solid.items() if kind in sound)
        yield f"cells of several kinds: {found}; remedy: mesh it with one kind, or one file for each kind"


def _nothing_solid(raw: RawMesh) -> Iterator[str]:
    """Yield a line if a file has no solid cells."""
    counts = _counts(raw)
    if not any(map(_remedy, counts)):
        found = ", ".join(f"{n} {kind}" for kind, n in counts.items()) or "no cells at all"
        flat = any(kind.startswith(("triangle", "quad", "polygon")) for kind in counts)
        yield f"there are no hexahedra and no tetrahedra, only: {found}; remedy: {_FILL if flat else 'mesh it'}"


def _damaged(raw: RawMesh) -> Iterator[str]:
    """Yield a line if cells have too few vertices, and a line if the points do not have three coordinates."""
    least = [(8, block.data) for block in _blocks(raw, "hexahedron").values()]
    least += [(int(block.type[5:] or 4), block.data) for block in _blocks(raw, "tetra").values()]
    if any(np.ndim(data) != 2 or np.shape(data)[1] < count for count, data in least):
        yield "a cell has fewer vertices than its kind needs: the file seems cut off; remedy: export it again"
    if raw.points.ndim != 2 or raw.points.shape[1] != 3:
        yield f"the points have {raw.points.shape[-1]} coordinates; allowed: 3"


def _remedy(kind: str) -> str | None:
    return next((remedy for start, remedy in _REMEDIES.items() if kind.startswith(start)), None)


def _blocks(raw: RawMesh, kind: str) -> dict[int, CellBlock]:
    """Return a dict from the number of each block of cells whose kind begins with ``kind`` to the block."""
    return {i: block for i, block in enumerate(raw.cells) if block.type.startswith(kind) and len(block.data)}


def _solid_mesh(raw: RawMesh, heading: str) -> Mesh:
    """Return the mesh of hexahedra or second-order tetrahedra; first-order tetrahedra are raised to second order."""
    tets = _blocks(raw, "tetra")
    blocks = tets or _blocks(raw, "hexahedron")
    cells = np.concatenate([np.asarray(block.data)[:, : None if tets else 8] for block in blocks.values()])
    wrong = np.flatnonzero(((cells < 0) | (cells >= len(raw.points))).any(axis=1))
    if len(wrong):
        text = f"{len(wrong)} cells name vertices outside 0 to {len(raw.points) - 1}: {list_ids(wrong)}"
        raise MeshError(heading, [f"{text}; remedy: repair the file"])
    starts = np.cumsum([0, *(len(block.data) for block in blocks.values())]).tolist()
    sets = named_sets(raw, dict(zip(blocks, starts, strict=False)))
    if cells.shape[1] == 4:
        return raised(raw.points, cells, *sets, linear=True)
    return (TetMesh if tets else HexMesh)(raw.points, cells, *sets)

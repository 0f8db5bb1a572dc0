# SPDX-License-Identifier: Apache-2.0
"""Import of hexahedra or tetrahedra from files: Gmsh, VTK, Abaqus and other formats.

The first bytes of a file tell its kind, except for Abaqus. meshio reads most kinds. If it fails or skips cells, gmsh or
VTK convert the file in a separate process.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh.assembly import keep_cells, merge_vertices
from gdfe_ros.mesh.files.abaqus_file import read_abaqus
from gdfe_ros.mesh.files.mesh_input import limit_time, require_file, run_mesher, unit_defects
from gdfe_ros.mesh.files.raw_mesh import CellBlock, RawMesh, read_sets
from gdfe_ros.mesh.mesh import HexMesh, Mesh
from gdfe_ros.mesh.quality import check_mesh, list_ids
from gdfe_ros.mesh.tetmesh import TetMesh, elevate

#: Suffixes that the tests cover; meshio reads more.
SUFFIXES = (".msh", ".vtk", ".vtu", ".inp")
HEAD = 2048
"""Number of bytes at the start of a file that tell its kind."""
LEAST_RUN, SLOWEST = 9.0, 2e6
"""LEAST_RUN: time limit of a reader for a small file [s]. SLOWEST: bytes that add another second to the limit."""
_XML_COUNT = re.compile(rb'NumberOfCells="\s*(\d+)')
_LEGACY_COUNT = re.compile(rb"\nCELL_TYPES\s+(\d+)")
_GMSH, _LEGACY, _XML = ".msh of gmsh", ".vtk (legacy VTK)", ".vtu (VTK XML)"
_ENDS = {_GMSH: [b"$EndElements", b"$ENDELM"], _XML: [b"</VTKFile>"]}
"""Dict from the kind of a file to its end marks; a file without any of them is cut off."""
_FORMATS = {_GMSH: "gmsh", _LEGACY: "vtk", _XML: "vtu"}


def read_file(path: Path, heading: str) -> RawMesh:
    """Return the content of a mesh file.

    Raises:
        MeshError: there is no such file, or it cannot be read; the error names the kind of the file and the remedy.
    """
    require_file(path, heading)
    with path.open("rb") as file:
        head = file.read(HEAD)
    if not head.strip():
        raise MeshError(heading, ["the file is empty; remedy: export it again"])
    kind = _kind(head)
    if kind is None and path.suffix.lower() == ".inp":
        return read_abaqus(path, heading)
    raw = _by_meshio(path, kind, heading)
    if kind is None:
        return raw
    if raw is not None and _is_whole(raw, path, kind):
        return raw
    if raw is not None and kind == _GMSH and find_spec("gmsh") is None:
        text = "elements with several physical groups are in the first one only"
        raw.remarks.append(f"{text}; remedy: pip install 'gdfe_ros[cad]', or give each group a name")
        return raw
    return _by_library(path, kind, heading)


def _kind(head: bytes) -> str | None:
    """Return the kind of a file with the bytes ``head`` at its start; None if they do not tell it."""
    start = head.removeprefix(b"\xef\xbb\xbf").lstrip()
    if start.startswith((b"$MeshFormat", b"$NOD", b"$Comments", b"$PhysicalNames")):
        return _GMSH
    if start.startswith(b"# vtk DataFile"):
        return _LEGACY
    return _XML if b"<VTKFile" in head else None


def _by_meshio(path: Path, kind: str | None, heading: str) -> RawMesh | None:
    """Return the content of a file as meshio reads it; None if meshio fails but gmsh or VTK can read the file.

    Raises:
        MeshError: meshio is not installed, does not know the suffix of the file, or fails on another kind of file.
    """
    try:
        library = import_module("meshio")
    except ImportError as error:
        raise MeshError(heading, ["meshio is not installed; remedy: pip install 'gdfe_ros[mesh]'"]) from error
    if kind is None and path.suffix.lower() not in library.extension_to_filetypes:
        raise MeshError(heading, [f"unknown kind of file {path.suffix!r}; allowed: {', '.join(SUFFIXES)}"])
    try:
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()), np.errstate(all="ignore"), limit_time(path):
            raw = library.read(path, file_format=_FORMATS.get(kind))
    except TimeoutError as error:
        raise MeshError(heading, [f"cannot be read: {error}; remedy: export it again"]) from error
    except (Exception, SystemExit) as error:  # on a broken file meshio's parsers raise any exception, or exit
        if kind is not None:
            return None
        own = str(error) if isinstance(error, library.ReadError) and str(error) else "its content does not fit its kind"
        remedy = f"remedy: export it again, as one of {', '.join(SUFFIXES)}"
        raise MeshError(heading, [f"cannot be read as {path.suffix}: {own}; {remedy}"]) from error
    same = ("points", "cell_sets", "point_sets", "cell_data", "point_data", "field_data")
    cells = [CellBlock(block.type, block.data, block.dim) for block in raw.cells]
    return RawMesh(cells=cells, **{name: getattr(raw, name) for name in same})


def _is_whole(raw: RawMesh, path: Path, kind: str) -> bool:
    """Return whether meshio is sure to have read all of a file of gmsh or VTK.

    meshio omits cells of unknown kinds. Of the physical groups of an element it reads only the first, unless the file
    has version 4.1 and the groups have names.
    """
    content = path.read_bytes()
    if kind == _GMSH:
        named = {(int(tag), int(dim)) for tag, dim in raw.field_data.values()}
        data = raw.cell_data.get("gmsh:physical", [])
        groups = {
            (int(tag), block.dim) for block, tags in zip(raw.cells, data, strict=False) for tag in np.unique(tags)
        }
        version = content[:HEAD].partition(b"$MeshFormat")[2].split()[:1]
        return version != [b"4"] and (version != [b"4.1"] or groups <= named)
    found = _XML_COUNT.findall(content) if kind == _XML else _LEGACY_COUNT.findall(content)
    return sum(map(int, found)) == sum(len(block.data) for block in raw.cells) > 0


def _by_library(path: Path, kind: str, heading: str) -> RawMesh:
    """Return the content of a file that gmsh or VTK convert for meshio in a separate process."""
    content = path.read_bytes()
    if not any(mark in content for mark in _ENDS.get(kind, [b""])):
        text = f"cannot be read as {kind}: the file is cut off before {_ENDS[kind][0].decode()}"
        raise MeshError(heading, [f"{text}; remedy: export it again"])
    longest = LEAST_RUN + len(content) / SLOWEST
    which = "gmsh" if kind == _GMSH else "vtk"
    with TemporaryDirectory() as folder:
        target = Path(folder, "mesh.msh")
        request = {"path": str(path.resolve()), "target": str(target)}
        try:
            run_mesher(which, request, heading, longest=longest, noun="reader")
            if (raw := _by_meshio(target, _GMSH if kind == _GMSH else _XML, heading)) is None:
                raise MeshError(heading, ["its content does not fit its kind"])
        except MeshError as error:
            defects = [f"cannot be read as {kind}: {text}" for text in map(_add_remedy, error.defects)]
            raise MeshError(heading, defects) from error
    return raw


def _add_remedy(text: str) -> str:
    return text if "remedy" in text else f"{text}; remedy: export it again"


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
    defects = [*_wrong_kinds(raw, first_order), *_nothing_solid(raw), *_find_damage(raw)]
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


def _counts(raw: RawMesh) -> dict[str, int]:
    """Return a dict from kind of cell to number of cells."""
    counts: dict[str, int] = {}
    for block in raw.cells:
        if len(block.data):
            counts[block.type] = counts.get(block.type, 0) + len(block.data)
    return counts


def _wrong_kinds(raw: RawMesh, first_order: bool) -> Iterator[str]:
    """Yield a defect for each kind of cell that cannot be used, and one for kinds that cannot be mixed."""
    solid = {kind: n for kind, n in _counts(raw).items() if _remedy(kind)}
    tets = [kind for kind in solid if kind in _TETRAHEDRA]
    hexes = [kind for kind in solid if kind.startswith("hexahedron")]
    sound = {*_TETRAHEDRA, "hexahedron", *(hexes if first_order else ())}
    for kind in (kind for kind in solid if kind not in sound):
        allowed = "8-vertex hexahedra, or tetrahedra with 4 or 10 nodes"
        yield f"{solid[kind]} cells of the kind {kind}; allowed: {allowed}; remedy: {_remedy(kind)}"
    if tets and (len(tets) > 1 or hexes):
        found = ", ".join(f"{n} {kind}" for kind, n in solid.items() if kind in sound)
        yield f"cells of several kinds: {found}; remedy: mesh it with one kind, or one file for each kind"


def _nothing_solid(raw: RawMesh) -> Iterator[str]:
    """Yield a defect if a file has no solid cells."""
    counts = _counts(raw)
    if not any(map(_remedy, counts)):
        found = ", ".join(f"{n} {kind}" for kind, n in counts.items()) or "no cells at all"
        flat = any(kind.startswith(("triangle", "quad", "polygon")) for kind in counts)
        yield f"there are no hexahedra and no tetrahedra, only: {found}; remedy: {_FILL if flat else 'mesh it'}"


def _find_damage(raw: RawMesh) -> Iterator[str]:
    """Yield a defect if cells have too few vertices, and one if the points do not have three coordinates."""
    least = [(8, block.data) for block in _blocks(raw, "hexahedron").values()]
    least += [(int(block.type[5:] or 4), block.data) for block in _blocks(raw, "tetra").values()]
    if any(np.ndim(data) != 2 or np.shape(data)[1] < count for count, data in least):
        yield "a cell has fewer vertices than its kind needs: the file seems cut off; remedy: export it again"
    if raw.points.ndim != 2 or raw.points.shape[1] != 3:
        yield f"the points have {raw.points.shape[-1]} coordinates; allowed: 3"


def _remedy(kind: str) -> str | None:
    return next((remedy for start, remedy in _REMEDIES.items() if kind.startswith(start)), None)


def _blocks(raw: RawMesh, kind: str) -> dict[int, CellBlock]:
    """Return the nonempty blocks whose kind begins with ``kind``, in a dict from their index in the file."""
    return {i: block for i, block in enumerate(raw.cells) if block.type.startswith(kind) and len(block.data)}


def _solid_mesh(raw: RawMesh, heading: str) -> Mesh:
    """Return the mesh of a file's hexahedra or tetrahedra; first-order tetrahedra are raised to second order."""
    tets = _blocks(raw, "tetra")
    blocks = tets or _blocks(raw, "hexahedron")
    cells = np.concatenate([np.asarray(block.data)[:, : None if tets else 8] for block in blocks.values()])
    wrong = np.flatnonzero(((cells < 0) | (cells >= len(raw.points))).any(axis=1))
    if len(wrong):
        text = f"{len(wrong)} cells name vertices outside 0 to {len(raw.points) - 1}: {list_ids(wrong)}"
        raise MeshError(heading, [f"{text}; remedy: repair the file"])
    starts = np.cumsum([0, *(len(block.data) for block in blocks.values())]).tolist()
    sets = read_sets(raw, dict(zip(blocks, starts, strict=False)))
    if cells.shape[1] == 4:
        return elevate(raw.points, cells, *sets, linear=True)
    return (TetMesh if tets else HexMesh)(raw.points, cells, *sets)

# SPDX-License-Identifier: Apache-2.0
"""Script for meshers and readers in a separate process: ``python mesher_process.py KIND REQUEST.npz RESULT.npz``.

gmsh's licence (GPL) requires a separate process. It also protects the simulator from libraries that crash or hang on a
broken file. This script imports no other module of the package. The result of a mesher has the arrays ``vertices``
(n, 3) [m], ``cells`` (m, 4) or (m, 10) in VTK's order, and ``cell:NAME`` and ``vertex:NAME`` for sets. A reader
converts the file ``path`` into the file ``target``, which meshio can read. If a task fails, the result has only a text:
``defect``, or ``missing`` with the name of a package that is not installed.
"""

from __future__ import annotations

import itertools
import sys
from inspect import signature

import numpy as np

MOST_CELLS = 2_000_000
"""Limit of the expected number of tetrahedra; more tetrahedra need tens of gigabytes of memory."""
FINEST = 0.2
"""Shortest edge at curved surfaces, divided by the requested size."""
BACKGROUND = "sizes.txt"
"""Name of the file from which gmsh reads the allowed size of cells at the points of a grid."""
FACETS_AROUND, FACETS_FINEST = 48, 0.15
"""Facets of a STEP file's surface: number of edges around a full circle, and shortest edge divided by the longest."""
AROUND = 12
"""Number of edges around a full circle. Quadratic edges deviate from the circle by at most 1e-4 of its radius."""
_GMSH_TRIANGLE, _GMSH_TET10, _VTK_ORDER = 2, 11, [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]

_SIX = [(0, 4, 6, 7), (0, 6, 2, 7), (0, 2, 3, 7), (0, 3, 1, 7), (0, 1, 5, 7), (0, 5, 4, 7)]
"""Corners of the six tetrahedra around the diagonal of a brick. The number of a brick's corner is 4 x + 2 y + z."""

_ARBITRARY = "VTK_LAGRANGE_"
_FIRST = {"TETRAHEDRON4": "tetra", "HEXAHEDRON8": "hexahedron", "WEDGE6": "wedge", "PYRAMID5": "pyramid"}
"""Dict from VTK's Lagrange cells, with their number of points, to the equivalent first-order cells of meshio."""


def estimate_cells(volume: float | np.ndarray, size: float | np.ndarray) -> float | np.ndarray:
    """Return the expected number of cells: ``volume`` [m^3] / volume of a regular tetrahedron of edge ``size`` [m]."""
    return volume / (2.0**0.5 / 12.0 * size**3)


def too_many(volume: float, size: float) -> str:
    """Return the text of a defect if a mesh would have too many cells; an empty text if not."""
    count = estimate_cells(volume, size)
    if count <= MOST_CELLS:
        return ""
    fitting = size * (count / MOST_CELLS) ** (1.0 / 3.0)
    text = f"size = {size:g} m gives about {count:.2g} tetrahedra; allowed: up to {MOST_CELLS:g}"
    return f"{text}; remedy: a size of at least {fitting:.2g} m"


def facts(request: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return number and names of solids, number of surfaces, bounds [m], and `_volumes` of a STEP file."""
    import gmsh

    solids = _import(gmsh, request)
    found = {
        "solids": np.array(len(solids)),
        "surfaces": np.array(len(gmsh.model.getEntities(2))),
        "names": np.array([gmsh.model.getEntityName(3, tag) for _, tag in solids], dtype=str),
        "bounds": np.array(gmsh.model.getBoundingBox(-1, -1)).reshape(2, 3),
    }
    return {**found, **_volumes(gmsh, _unite(gmsh, solids))}


def facets(request: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the surface of each solid of a STEP file as triangles, with normals out of this solid.

    The arrays are ``vertices`` (n, 3) [m], ``triangles`` (t, 3), and the number ``solid`` (t,) of each triangle's
    solid. Where two solids touch, each of them has its own triangles.
    """
    import gmsh

    size = float(request["size"])
    solids = _unite(gmsh, _import(gmsh, request))
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.option.setNumber("Mesh.MeshSizeMin", FACETS_FINEST * size)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", FACETS_AROUND)
    gmsh.model.mesh.generate(2)
    vertices, number = _nodes(gmsh)
    triangles, solid = [], []
    for k, pieces in enumerate(solids):
        outer = set(gmsh.model.getBoundary(pieces, oriented=False))
        for piece in pieces:
            gmsh.model.mesh.setOutwardOrientation(piece[1])
            for face in [face for face in gmsh.model.getBoundary([piece], oriented=False) if face in outer]:
                nodes = gmsh.model.mesh.getElementsByType(_GMSH_TRIANGLE, face[1])[1].reshape(-1, 3)
                triangles.append(number[nodes.astype(np.int64)])
                solid.append(np.full(len(nodes), k))
    found = {"triangles": np.concatenate(triangles), "solid": np.concatenate(solid)} if solids else {}
    return {"vertices": vertices, **found}


def _nodes(gmsh) -> tuple[np.ndarray, np.ndarray]:
    """Return the positions (n, 3) [m] of the nodes, and an array from gmsh's node number to the index of the node."""
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    number = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    number[tags.astype(np.int64)] = np.arange(len(tags))
    return coordinates.reshape(-1, 3), number


def _unite(gmsh, solids: list[tuple[int, int]]) -> list[list[tuple[int, int]]]:
    """Divide solids where they touch or overlap; return the (dimension, tag) of the pieces of each solid.

    Pieces have common faces where they touch. A piece in the overlap of several solids belongs to each of them.
    """
    if len(solids) < 2:
        return [[solid] for solid in solids]
    _, pieces = gmsh.model.occ.fragment(solids[:1], solids[1:])
    gmsh.model.occ.synchronize()
    return pieces


def _volumes(gmsh, solids: list[list[tuple[int, int]]]) -> dict[str, np.ndarray]:
    """Return the ``volume`` [m^3] of all pieces of `_unite`, and ``overlaps`` (k, 3): two solids, common volume [m^3].

    Solids are counted from 1.
    """
    mass = {piece: gmsh.model.occ.getMass(*piece) for pieces in solids for piece in pieces}
    overlaps = [
        (first + 1, second + 1, sum(mass[piece] for piece in common))
        for first, second in itertools.combinations(range(len(solids)), 2)
        if (common := set(solids[first]) & set(solids[second]))
    ]
    return {"volume": np.array(sum(mass.values())), "overlaps": np.array(overlaps).reshape(-1, 3)}


def _import(gmsh, request: dict[str, np.ndarray]) -> list[tuple[int, int]]:
    """Load a STEP file into gmsh, in metres; return gmsh's (dimension, tag) of each solid."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setString("Geometry.OCCTargetUnit", "M")
    gmsh.model.occ.importShapes(str(request["path"]))
    gmsh.model.occ.synchronize()
    return gmsh.model.getEntities(3)


def from_step(request: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the mesh of a STEP file's solids: quadratic tetrahedra, with curved edges on curved surfaces."""
    import gmsh

    size = float(request["size"])
    solids = _import(gmsh, request)
    if not solids:
        return {"defect": np.array("there is no solid in it; remedy: export the body as a solid, not as surfaces")}
    low, high = np.split(np.array(gmsh.model.getBoundingBox(-1, -1)), 2)
    diagonal = float(np.linalg.norm(high - low))
    solids = _unite(gmsh, solids)
    volumes = _volumes(gmsh, solids)
    if defect := too_many(float(volumes["volume"]), size):
        return {"defect": np.array(defect)}
    if size > diagonal:
        text = f"size = {size:g} m, but the body's diagonal is {diagonal:.3g} m; remedy: a smaller size"
        return {"defect": np.array(text)}
    if "sizes" in request:
        _set_background(gmsh, request)
    for name, value in {
        "MeshSizeMax": size,
        "MeshSizeMin": float(request.get("least_size", FINEST * size)),
        "MeshSizeFromCurvature": AROUND,
        "ElementOrder": 2,
        "HighOrderOptimize": 1,
    }.items():
        gmsh.option.setNumber(f"Mesh.{name}", value)
    gmsh.model.mesh.generate(3)
    return {**_gmsh_cells(gmsh, solids), "overlaps": volumes["overlaps"]}


def _set_background(gmsh, request: dict[str, np.ndarray]) -> None:
    """Set the largest edge [m] of cells: gmsh interpolates it from the ``sizes`` (a, b, c) at the points of a grid."""
    sizes = request["sizes"]
    rows = request["start"], np.full(3, request["spacing"]), np.array(sizes.shape), sizes.ravel()
    with open(BACKGROUND, "w", encoding="ascii") as file:
        file.writelines(" ".join(map(repr, row.tolist())) + "\n" for row in rows)
    field = gmsh.model.mesh.field.add("Structured")
    gmsh.model.mesh.field.setString(field, "FileName", BACKGROUND)
    gmsh.model.mesh.field.setNumber(field, "TextFormat", 1)
    gmsh.model.mesh.field.setAsBackgroundMesh(field)


def _gmsh_cells(gmsh, solids: list[list[tuple[int, int]]]) -> dict[str, np.ndarray]:
    """Return the mesh of gmsh's model, with a cell set for each solid (`_unite`) and a vertex set for each surface.

    A vertex set has the surface's name in the file without its path, or the name ``surface_`` and the surface's tag.
    """
    vertices, number = _nodes(gmsh)
    found, cells, places, start = {"vertices": vertices}, [], {}, 0
    for piece in gmsh.model.getEntities(3):
        kinds, _, nodes = gmsh.model.mesh.getElements(*piece)
        own = [part.reshape(-1, 10) for kind, part in zip(kinds, nodes, strict=True) if kind == _GMSH_TET10]
        own = number[np.concatenate(own)][:, _VTK_ORDER]
        places[piece] = np.arange(start, start + len(own))
        cells.append(own)
        start += len(own)
    for k, pieces in enumerate(solids):
        found[f"cell:solid_{k + 1}"] = np.sort(np.concatenate([places[piece] for piece in pieces]))
    for _, surface in gmsh.model.getEntities(2):
        nodes, _, _ = gmsh.model.mesh.getNodes(2, surface, includeBoundary=True)
        name = gmsh.model.getEntityName(2, surface).rpartition("/")[2].strip() or f"surface_{surface}"
        found[f"vertex:{name}"] = np.unique(number[nodes.astype(np.int64)])
    return {**found, "cells": np.concatenate(cells)}


def from_surface(request: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Fill a surface of triangles, which may be open or intersect itself, with linear tetrahedra (fTetWild)."""
    import pytetwild

    if "sizes" in request and "bg_values" not in signature(pytetwild.tetrahedralize).parameters:
        text = "this version of pytetwild makes cells of one size only; allowed: 0.4.2 or newer for `least_size`"
        return {"defect": np.array(f"{text}; remedy: pip install --upgrade 'gdfe_ros[cad]', or leave out least_size")}
    vertices, cells = pytetwild.tetrahedralize(
        np.ascontiguousarray(request["vertices"]),
        request["triangles"].astype(np.int32),
        edge_length_abs=float(request["size"]),
        epsilon=float(request["epsilon"]),
        num_threads=1,
        quiet=True,
        **(_background(request) if "sizes" in request else {}),
    )
    corners = vertices[cells]
    volume = np.linalg.det(corners[:, 1:] - corners[:, :1])
    cells[volume < 0.0] = cells[volume < 0.0][:, [0, 2, 1, 3]]
    return {"vertices": vertices, "cells": cells}


def _background(request: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return a background mesh for fTetWild: tetrahedra between the points of a grid, with the sizes (a, b, c) [m]."""
    sizes = request["sizes"]
    index = np.arange(sizes.size).reshape(sizes.shape)
    low, high = slice(None, -1), slice(1, None)
    bricks = [index[part].ravel() for part in itertools.product((low, high), repeat=3)]
    places = np.stack(np.unravel_index(index.ravel(), sizes.shape), axis=1)
    return {
        "bg_vertices": request["start"] + request["spacing"] * places,
        "bg_tets": np.concatenate([np.stack([bricks[k] for k in ids], axis=1) for ids in _SIX]).astype(np.int32),
        "bg_values": sizes.ravel(),
    }


def convert_gmsh(request: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Convert a file of gmsh to version 4.1 of its format, with a name for each physical group."""
    import gmsh

    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.logger.start()
    gmsh.merge(str(request["path"]))
    faults = [line for line in gmsh.logger.get() if line.startswith("Error")]
    if faults:
        return {"defect": np.array(f"gmsh says: {faults[0].partition(': ')[2]}")}
    for dimension, tag in gmsh.model.getPhysicalGroups():
        if not gmsh.model.getPhysicalName(dimension, tag):
            gmsh.model.setPhysicalName(dimension, tag, f"physical_{tag}")
    for dimension in range(4):  # meshio needs a group of each entity; it leaves out names that begin like this
        bare = [tag for _, tag in gmsh.model.getEntities(dimension)
                if not len(gmsh.model.getPhysicalGroupsForEntity(dimension, tag))]  # fmt: skip
        if bare:
            gmsh.model.addPhysicalGroup(dimension, bare, name=f"gmsh:bare{dimension}")
    for name, value in {"MshFileVersion": 4.1, "Binary": 1, "SaveAll": 1, "SaveParametric": 0}.items():
        gmsh.option.setNumber(f"Mesh.{name}", value)
    gmsh.write(str(request["target"]))
    return {}


def convert_vtk(request: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Convert a legacy or XML file of VTK into a file that meshio can read; the cells of structured grids included."""
    import meshio
    import pyvista
    from vtkmodules.vtkCommonCore import vtkOutputWindow, vtkStringOutputWindow
    from vtkmodules.vtkCommonDataModel import vtkDataSet
    from vtkmodules.vtkIOLegacy import vtkDataSetReader
    from vtkmodules.vtkIOXML import vtkXMLGenericDataObjectReader

    path, said = str(request["path"]), vtkStringOutputWindow()
    vtkOutputWindow.SetInstance(said)
    with open(path, "rb") as file:
        legacy = file.read(64).lstrip().startswith(b"# vtk")
    reader = vtkDataSetReader() if legacy else vtkXMLGenericDataObjectReader()
    reader.SetFileName(path)
    if legacy:
        reader.ReadAllScalarsOn()
        reader.ReadAllFieldsOn()
    reader.Update()
    data = reader.GetOutput()
    complaint = _complaint(said.GetOutput())
    if complaint:
        return {"defect": np.array(f"VTK says: {complaint}")}
    if not isinstance(data, vtkDataSet):
        kind = "nothing that VTK can read" if data is None else data.GetClassName()
        return {"defect": np.array(f"it contains {kind}; allowed: one grid (UnstructuredGrid)")}
    mesh = pyvista.to_meshio(pyvista.wrap(data))
    for number, block in enumerate(mesh.cells):
        same = _FIRST.get(f"{block.type.removeprefix(_ARBITRARY)}{np.shape(block.data)[-1]}", block.type)
        mesh.cells[number] = meshio.CellBlock(same, block.data)
    mesh.write(str(request["target"]), file_format="vtu")
    return {}


def _complaint(text: str) -> str:
    """Return the first error or warning in VTK's output, without source line and address; empty if there is none."""
    lines = [line.strip() for line in text.splitlines() if line.strip() and not line.startswith(("ERROR", "Warning"))]
    kept = [line.partition("): ")[2] or line for line in lines]
    return kept[0][:200] if kept else ""


_TASKS = {
    "step": from_step,
    "surface": from_surface,
    "facts": facts,
    "facets": facets,
    "gmsh": convert_gmsh,
    "vtk": convert_vtk,
}


def main(kind: str, request: str, result: str) -> None:
    """Run the task ``kind`` with the arguments in the file ``request``; write its result to the file ``result``."""
    with np.load(request, allow_pickle=False) as archive:
        given = dict(archive)
    try:
        found = _TASKS[kind](given)
    except ImportError as error:
        found = {"missing": np.array(str(error.name))}
    except Exception as error:  # gmsh raises plain exceptions with its own text
        text = "the data do not fit the header: the file seems cut off or damaged" if kind == "vtk" else error
        found = {"defect": np.array(f"{kind if kind in ('vtk', 'gmsh') else 'the mesher'} says: {text}")}
    np.savez(result, **found)


if __name__ == "__main__":
    main(*sys.argv[1:])

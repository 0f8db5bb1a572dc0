# SPDX-License-Identifier: Apache-2.0
"""Script that reads a mesh file by gmsh or by VTK: ``python reader_process.py KIND REQUEST.npz RESULT.npz``.

gmsh's licence (GPL) requires a separate process, and a reader that crashes or hangs on a broken file does not stop the
simulator. This file imports no module of the package. The result has the arrays ``points`` (n, 3), ``cells:TYPE`` with
the cells of each type of meshio in VTK's order, ``group:DIM:NAME:TYPE`` with ids of cells of a type, and
``cell_data:NAME:TYPE`` and ``point_data:NAME`` with whole numbers. If the reader fails, the result has the text
``defect`` instead, or ``missing`` with the name of a package that is not installed.
"""

from __future__ import annotations

import sys

import numpy as np

_GMSH = {1: "line", 2: "triangle", 3: "quad", 4: "tetra", 5: "hexahedron", 6: "wedge", 7: "pyramid", 8: "line3",
         9: "triangle6", 10: "quad9", 11: "tetra10", 12: "hexahedron27", 13: "wedge18", 14: "pyramid14", 15: "vertex",
         16: "quad8", 17: "hexahedron20", 18: "wedge15", 19: "pyramid13"}  # fmt: skip
_GMSH_SOLIDS = {"Tetrahedron": "tetra", "Hexahedron": "hexahedron", "Prism": "wedge", "Pyramid": "pyramid"}
_TET10 = [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]
"""Order of gmsh's nodes of a quadratic tetrahedron in VTK's order."""
_VTK = {1: "vertex", 2: "vertex", 3: "line", 4: "line", 5: "triangle", 6: "triangle", 7: "polygon", 8: "quad",
        9: "quad", 10: "tetra", 12: "hexahedron", 13: "wedge", 14: "pyramid", 21: "line3", 22: "triangle6",
        23: "quad8", 24: "tetra10", 25: "hexahedron20", 26: "wedge15", 27: "pyramid13", 28: "quad9",
        29: "hexahedron27", 32: "wedge18", 33: "hexahedron24", 37: "pyramid14", 42: "polyhedron"}  # fmt: skip
_ARBITRARY = {71: "tetra", 72: "hexahedron", 73: "wedge", 74: "pyramid", 78: "tetra", 79: "hexahedron", 80: "wedge"}
"""Cells of any order; those with as many points as the cells of first or second order are the same."""
_FIRST = {"tetra": 4, "hexahedron": 8, "wedge": 6, "pyramid": 5}
_VOXEL, _VOXEL_ORDER = 11, [0, 1, 3, 2, 4, 5, 7, 6]


def read_gmsh(path: str) -> dict[str, np.ndarray]:
    """Return the mesh of a file of gmsh, with its physical groups."""
    import gmsh

    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.logger.start()
    gmsh.merge(path)
    faults = [line for line in gmsh.logger.get() if line.startswith("Error")]
    if faults:
        return {"defect": np.array(f"gmsh says: {faults[0].partition(': ')[2]}")}
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    order = np.argsort(tags, kind="stable")
    number = np.zeros(int(tags.max(initial=0)) + 1, dtype=np.int64)
    number[tags[order].astype(np.int64)] = np.arange(len(tags))
    found: dict[str, list] = {}
    groups: dict[str, list] = {}
    for dimension, entity in gmsh.model.getEntities():
        names = [_group_name(gmsh, dimension, tag) for tag in gmsh.model.getPhysicalGroupsForEntity(dimension, entity)]
        for kind, _, nodes in zip(*gmsh.model.mesh.getElements(dimension, entity), strict=True):
            name, width = _gmsh_type(gmsh, int(kind))
            block = number[nodes.astype(np.int64).reshape(-1, width)]
            start = sum(map(len, found.get(name, [])))
            found.setdefault(name, []).append(block[:, _TET10] if name == "tetra10" else block)
            for group in names:
                groups.setdefault(f"group:{dimension}:{group}:{name}", []).append(np.arange(start, start + len(block)))
    arrays = {f"cells:{name}": np.concatenate(blocks) for name, blocks in found.items()}
    arrays |= {key: np.concatenate(ids) for key, ids in groups.items()}
    return {"points": coordinates.reshape(-1, 3)[order], **arrays}


def _group_name(gmsh, dimension: int, tag: int) -> str:
    return gmsh.model.getPhysicalName(dimension, tag) or f"physical_{tag}"


def _gmsh_type(gmsh, kind: int) -> tuple[str, int]:
    """Return meshio's name of an element type of gmsh, and its number of nodes."""
    text, _, _, width, _, _ = gmsh.model.mesh.getElementProperties(kind)
    family = text.split()[0]
    return _GMSH.get(kind) or f"{_GMSH_SOLIDS.get(family, family.lower())}{width}", int(width)


def read_vtk(path: str) -> dict[str, np.ndarray]:
    """Return the mesh of a VTK file, legacy or XML; structured grids become cells, too."""
    from vtkmodules.vtkCommonCore import vtkOutputWindow, vtkStringOutputWindow
    from vtkmodules.vtkCommonDataModel import vtkDataSet
    from vtkmodules.vtkFiltersCore import vtkAppendFilter
    from vtkmodules.vtkIOLegacy import vtkDataSetReader
    from vtkmodules.vtkIOXML import vtkXMLGenericDataObjectReader

    said = vtkStringOutputWindow()
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
    if data.GetClassName() != "vtkUnstructuredGrid":
        join = vtkAppendFilter()
        join.AddInputData(data)
        join.Update()
        data = join.GetOutput()
    return _vtk_arrays(data)


def _complaint(text: str) -> str:
    """Return the first error or warning of VTK, in one line without place and address; empty if there is none."""
    lines = [line.strip() for line in text.splitlines() if line.strip() and not line.startswith(("ERROR", "Warning"))]
    kept = [line.partition("): ")[2] or line for line in lines]
    return kept[0][:200] if kept else ""


def _vtk_arrays(data) -> dict[str, np.ndarray]:
    """Return the arrays of an unstructured grid."""
    from vtkmodules.util.numpy_support import vtk_to_numpy

    if data.GetNumberOfCells() == 0:
        points = data.GetPoints()
        return {"points": np.zeros((0, 3)) if points is None else vtk_to_numpy(points.GetData()).astype(float)}
    kinds = vtk_to_numpy(data.GetCellTypes() if hasattr(data, "GetCellTypes") else data.GetCellTypesArray())
    offsets = vtk_to_numpy(data.GetCells().GetOffsetsArray()).astype(np.int64)
    ids = vtk_to_numpy(data.GetCells().GetConnectivityArray()).astype(np.int64)
    width = np.diff(offsets)
    names = np.array([_vtk_type(int(kind), int(count)) for kind, count in zip(kinds, width, strict=True)])
    arrays = {"points": vtk_to_numpy(data.GetPoints().GetData()).astype(np.float64)}
    arrays |= _whole_numbers(data.GetPointData(), "point_data:", [""], [slice(None)], vtk_to_numpy)
    unique = list(dict.fromkeys(names.tolist()))
    rows = [np.flatnonzero(names == name) for name in unique]
    for name, chosen in zip(unique, rows, strict=True):
        least = int(width[chosen].min())  # polygons and polyhedra of any size are only counted
        block = ids[offsets[chosen][:, None] + np.arange(least)]
        voxel = kinds[chosen] == _VOXEL
        block[voxel] = block[voxel][:, _VOXEL_ORDER] if voxel.any() else block[voxel]
        arrays[f"cells:{name}"] = block
    return arrays | _whole_numbers(
        data.GetCellData(), "cell_data:", [f":{name}" for name in unique], rows, vtk_to_numpy
    )


def _whole_numbers(data, start: str, ends: list[str], rows: list, to_numpy) -> dict[str, np.ndarray]:
    """Return the arrays of whole numbers of cells or points, for each of the ``rows``."""
    found = {}
    for k in range(data.GetNumberOfArrays()):
        array = data.GetArray(k)
        values = None if array is None else to_numpy(array)
        if values is not None and values.ndim == 1 and np.issubdtype(values.dtype, np.integer):
            found |= {f"{start}{data.GetArrayName(k)}{end}": values[row] for end, row in zip(ends, rows, strict=True)}
    return found


def _vtk_type(kind: int, count: int) -> str:
    """Return meshio's name of a cell type of VTK with ``count`` points."""
    if kind == _VOXEL:
        return "hexahedron"
    if kind not in _ARBITRARY:
        return _VTK.get(kind, f"vtk{kind}")
    family = _ARBITRARY[kind]
    return family if count == _FIRST[family] else f"{family}{count}"


def main(kind: str, request: str, result: str) -> None:
    """Read the request, read the file, write the result."""
    with np.load(request, allow_pickle=False) as archive:
        path = str(archive["path"])
    try:
        found = {"gmsh": read_gmsh, "vtk": read_vtk}[kind](path)
    except ImportError:
        found = {"missing": np.array("vtk" if kind == "vtk" else "gmsh")}
    except Exception as error:  # gmsh raises plain exceptions with its own text
        text = str(error) if kind == "gmsh" else "the data do not fit the header: the file seems cut off or damaged"
        found = {"defect": np.array(f"{kind} says: {text}")}
    np.savez(result, **{key.replace("/", "\\"): array for key, array in found.items()})


if __name__ == "__main__":
    main(*sys.argv[1:])

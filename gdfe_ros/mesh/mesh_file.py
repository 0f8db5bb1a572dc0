# SPDX-License-Identifier: Apache-2.0
"""Reading of mesh files: the first bytes tell the kind, and each kind has its readers.

meshio reads most files at once. Where it gives up, or skips cells, gmsh or VTK convert the file in a separate process.
"""

from __future__ import annotations

import re
from contextlib import redirect_stderr, redirect_stdout
from enum import Enum
from importlib import import_module
from importlib.util import find_spec
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh.abaqus_file import read_abaqus
from gdfe_ros.mesh.mesh_input import limited_time, require_file
from gdfe_ros.mesh.mesher import run_mesher
from gdfe_ros.mesh.raw_mesh import CellBlock, RawMesh

#: Suffixes that the tests cover; meshio reads more.
SUFFIXES = (".msh", ".vtk", ".vtu", ".inp")
HEAD = 2048
"""Number of bytes at the start of a file that tell its kind."""
LEAST_RUN, SLOWEST = 9.0, 2e6
"""A reader's time [s] for a small file, and the bytes of a large file for which it gets another second."""
_XML_COUNT = re.compile(rb'NumberOfCells="\s*(\d+)')
_LEGACY_COUNT = re.compile(rb"\nCELL_TYPES\s+(\d+)")
_GMSH, _LEGACY, _XML = ".msh of gmsh", ".vtk (legacy VTK)", ".vtu (VTK XML)"
_ENDS = {_GMSH: [b"$EndElements", b"$ENDELM"], _XML: [b"</VTKFile>"]}
"""Dict from kind to texts of which a whole file has one."""
_FORMATS = {_GMSH: "gmsh", _LEGACY: "vtk", _XML: "vtu"}


class Doubt(Enum):
    """What may be missing in the content that meshio has read."""

    CELLS = "cells"
    GROUPS = "groups"


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
    if raw is not None and not (doubt := _doubt(raw, path, kind)):
        return raw
    if raw is not None and doubt is Doubt.GROUPS and find_spec("gmsh") is None:
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
    """Return the content of a file as meshio reads it; None if it gives up on a file that gmsh or VTK can read.

    Raises:
        MeshError: meshio is not installed, does not know the suffix of the file, or gives up on another kind of file.
    """
    try:
        library = import_module("meshio")
    except ImportError as error:
        raise MeshError(heading, ["meshio is not installed; remedy: pip install 'gdfe_ros[mesh]'"]) from error
    if kind is None and path.suffix.lower() not in library.extension_to_filetypes:
        raise MeshError(heading, [f"unknown kind of file {path.suffix!r}; allowed: {', '.join(SUFFIXES)}"])
    try:
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()), np.errstate(all="ignore"), limited_time(path):
            raw = library.read(path, file_format=_FORMATS.get(kind))
    except TimeoutError as error:
        raise MeshError(heading, [f"cannot be read: {error}; remedy: export it again"]) from error
    except (Exception, SystemExit) as error:  # on a broken file meshio's parsers raise any exception, or exit
        if kind is not None:
            return None
        own = str(error) if isinstance(error, library.ReadError) and str(error) else "its content does not fit its kind"
        remedy = f"remedy: export it again, as one of {', '.join(SUFFIXES)}"
        raise MeshError(heading, [f"cannot be read as {path.suffix}: {own}; {remedy}"]) from error
    return RawMesh(
        points=raw.points,
        cells=[CellBlock(block.type, block.data, block.dim) for block in raw.cells],
        cell_sets=raw.cell_sets,
        point_sets=raw.point_sets,
        cell_data=raw.cell_data,
        point_data=raw.point_data,
        field_data=raw.field_data,
    )


def _doubt(raw: RawMesh, path: Path, kind: str) -> Doubt | None:
    """Return what of a file may be missing in meshio's content; None if it is complete.

    meshio leaves out cells of kinds that it does not know, and all but the first physical group of an element, unless
    the file has version 4.1 and the groups have names.
    """
    content = path.read_bytes()
    if kind == _GMSH:
        named = {(int(tag), int(dim)) for tag, dim in raw.field_data.values()}
        data = raw.cell_data.get("gmsh:physical", [])
        groups = {
            (int(tag), block.dim) for block, tags in zip(raw.cells, data, strict=False) for tag in np.unique(tags)
        }
        version = content[:HEAD].partition(b"$MeshFormat")[2].split()[:1]
        if version == [b"4"] or (version == [b"4.1"] and not groups <= named):
            return Doubt.GROUPS
        return None
    found = _XML_COUNT.findall(content) if kind == _XML else _LEGACY_COUNT.findall(content)
    return None if sum(map(int, found)) == sum(len(block.data) for block in raw.cells) > 0 else Doubt.CELLS


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
            defects = [f"cannot be read as {kind}: {text}" for text in map(_remedied, error.defects)]
            raise MeshError(heading, defects) from error
    return raw


def _remedied(text: str) -> str:
    return text if "remedy" in text else f"{text}; remedy: export it again"

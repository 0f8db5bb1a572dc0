# SPDX-License-Identifier: Apache-2.0
"""A mesh as one line of text, so that scenes and bags can contain it."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields
from io import BytesIO

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh.filling import Filling
from gdfe_ros.mesh.mesh import HexMesh, Mesh
from gdfe_ros.mesh.tetmesh import TetMesh

_CELL_SET, _VERTEX_SET, _FILLING = "cell_set:", "vertex_set:", "filling:"
_VERTICES, _TRIANGLES, _SLASH = "vertices:", "triangles:", "\\"
_LARGEST = 1 << 30
"""Largest size of the arrays of a packed mesh [bytes]; a small archive can expand to any size."""


def pack_mesh(mesh: Mesh) -> str:
    """Return the mesh, without its skin, as base64 of a compressed npz archive; exact bit by bit."""
    return _pack(mesh_arrays(mesh))


def mesh_arrays(mesh: Mesh) -> dict[str, NDArray]:
    """Return a dict from name to array with the arrays of a mesh, without those of its skin."""
    arrays = {"vertices": mesh.vertices, "cells": mesh.cells}
    arrays |= {_CELL_SET + name: ids for name, ids in mesh.cell_sets.items()}
    arrays |= {_VERTEX_SET + name: ids for name, ids in mesh.vertex_sets.items()}
    if mesh.filling is not None:
        arrays |= {_FILLING + item.name: getattr(mesh.filling, item.name) for item in fields(mesh.filling)}
    return arrays


def pack_surface(vertices: NDArray[np.float64], triangles: NDArray[np.int64]) -> str:
    """Return a surface of triangles as text in the format of `pack_mesh`."""
    return _pack({"vertices": vertices, "triangles": triangles})


def pack_robot(text: str, surfaces: Mapping[str, tuple[NDArray[np.float64], NDArray[np.int64]]]) -> str:
    """Return a robot as text in the format of `pack_mesh`.

    Args:
        text: the robot's URDF.
        surfaces: dict from the URI of each mesh in the URDF to its vertices (n, 3) [m] and triangles (t, 3).
    """
    arrays = {"urdf": np.frombuffer(text.encode(), dtype=np.uint8)}
    for uri, (vertices, triangles) in surfaces.items():
        arrays |= {_VERTICES + uri: vertices, _TRIANGLES + uri: triangles}
    return _pack({key.replace("/", _SLASH): array for key, array in arrays.items()})


def unpack_robot(text: str) -> tuple[str, dict[str, tuple[NDArray[np.float64], NDArray[np.int64]]]]:
    """Return the URDF and the dict of surfaces that were given to `pack_robot`.

    Raises:
        MeshError: the text is damaged, or is not a packed robot.
    """
    with _undamaged("robot"):
        arrays = {key.replace(_SLASH, "/"): array for key, array in _unpack(text).items()}
        uris = [key.removeprefix(_VERTICES) for key in arrays if key.startswith(_VERTICES)]
        surfaces = {uri: (arrays[_VERTICES + uri], arrays[_TRIANGLES + uri]) for uri in uris}
        return arrays["urdf"].tobytes().decode(), surfaces


def unpack_mesh(text: str) -> Mesh:
    """Return the mesh that was given to `pack_mesh`.

    Raises:
        MeshError: the text is damaged, or is not a packed mesh.
    """
    with _undamaged("mesh"):
        return mesh_of(_unpack(text))


def mesh_of(arrays: dict[str, NDArray]) -> Mesh:
    """Return the mesh whose arrays `mesh_arrays` returned."""
    cells, filled = arrays["cells"], under(arrays, _FILLING)
    kind = TetMesh if np.ndim(cells) == 2 and np.shape(cells)[1] == TetMesh.nodes else HexMesh
    sets = under(arrays, _CELL_SET), under(arrays, _VERTEX_SET)
    return kind(arrays["vertices"], cells, *sets, Filling(**filled) if filled else None)


def under(named: Mapping[str, NDArray], head: str) -> dict[str, NDArray]:
    """Return the arrays whose names begin with ``head``, under the rest of their names."""
    return {name.removeprefix(head): array for name, array in named.items() if name.startswith(head)}


def unpack_surface(text: str) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the vertices (n, 3) [m] and triangles (t, 3) that were given to `pack_surface`.

    Raises:
        MeshError: the text is damaged, or is not a packed surface.
    """
    with _undamaged("surface"):
        arrays = _unpack(text)
        return arrays["vertices"], arrays["triangles"]


def _pack(arrays: dict[str, NDArray]) -> str:
    buffer = BytesIO()
    np.savez_compressed(buffer, **arrays)
    return base64.b64encode(buffer.getvalue()).decode("ascii")


def _unpack(text: str) -> dict[str, NDArray]:
    archive = np.load(BytesIO(base64.b64decode(text, validate=True)), allow_pickle=False)
    size = sum(entry.file_size for entry in archive.zip.infolist())
    if size > _LARGEST:
        raise ValueError(f"its arrays have {size} bytes; allowed: up to {_LARGEST}")
    return {name: archive[name] for name in archive.files}


@contextmanager
def _undamaged(what: str) -> Iterator[None]:
    """Convert any error that a damaged text causes in this context to MeshError."""
    try:
        yield
    except Exception as error:  # base64, zipfile, zlib and numpy raise many kinds of exceptions for damaged data
        text = f"damaged: {error}; remedy: read the scene from its file or bag again"
        raise MeshError(f"the embedded {what}", [text]) from error

# SPDX-License-Identifier: Apache-2.0
"""A mesh as one line of text, so that scenes and bags can contain it."""

from __future__ import annotations

import base64
import binascii
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields
from io import BytesIO

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh.filling import Filling
from gdfe_ros.mesh.hexmesh import HexMesh
from gdfe_ros.mesh.mesh import Mesh
from gdfe_ros.mesh.tetmesh import TetMesh

_CELL_SET, _VERTEX_SET, _FILLING = "cell_set:", "vertex_set:", "filling:"
_FILLED = tuple(item.name for item in fields(Filling))


def pack_mesh(mesh: Mesh) -> str:
    """Return the mesh as base64 of a compressed npz archive; exact bit by bit."""
    arrays = {"vertices": mesh.vertices, "cells": mesh.cells}
    arrays |= {_CELL_SET + name: ids for name, ids in mesh.cell_sets.items()}
    arrays |= {_VERTEX_SET + name: ids for name, ids in mesh.vertex_sets.items()}
    if mesh.filling is not None:
        arrays |= {_FILLING + item.name: getattr(mesh.filling, item.name) for item in fields(mesh.filling)}
    return _pack(arrays)


def pack_surface(vertices: NDArray[np.float64], triangles: NDArray[np.int64]) -> str:
    """Return a surface of triangles in the same format."""
    return _pack({"vertices": vertices, "triangles": triangles})


def unpack_mesh(text: str) -> Mesh:
    """Return the mesh that `pack_mesh` wrote.

    Raises:
        MeshError: the text is not such a mesh.
    """
    with _undamaged("mesh"):
        arrays = _unpack(text)
        vertices, cells = arrays.pop("vertices"), arrays.pop("cells")
        filled = {name: arrays.pop(_FILLING + name) for name in _FILLED if _FILLING + name in arrays}
        filling = Filling(**filled) if filled else None
    kind = TetMesh if np.ndim(cells) == 2 and np.shape(cells)[1] == TetMesh.nodes else HexMesh
    return kind(
        vertices,
        cells,
        {name.removeprefix(_CELL_SET): ids for name, ids in arrays.items() if name.startswith(_CELL_SET)},
        {name.removeprefix(_VERTEX_SET): ids for name, ids in arrays.items() if name.startswith(_VERTEX_SET)},
        filling,
    )


def unpack_surface(text: str) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the vertices (n, 3) [m] and triangles (t, 3) that `pack_surface` wrote.

    Raises:
        MeshError: the text is not such a surface.
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
    return {name: archive[name] for name in archive.files}


@contextmanager
def _undamaged(what: str) -> Iterator[None]:
    """Raise MeshError for any error in a damaged text."""
    try:
        yield
    except (
        binascii.Error,
        ValueError,
        KeyError,
        TypeError,
        EOFError,
        OSError,
        AttributeError,
        zipfile.BadZipFile,
        zlib.error,
    ) as error:
        text = f"damaged: {error}; remedy: take the scene from its file or bag again"
        raise MeshError(f"the embedded {what}", [text]) from error

# SPDX-License-Identifier: Apache-2.0
"""Meshes and surfaces as text in a scene, and a cache of computed meshes on disk.

The cache key is a digest of the input of a mesh. It also depends on the sources of `gdfe_ros.mesh`, numpy's version and
the machine's architecture, so that no other version reads the file. Files are replaced as a whole, so that concurrent
processes never read an incomplete file. A file starts with the digest of its content; if a power cut or a full disk has
truncated it, the mesh is computed again.
"""

from __future__ import annotations

import base64
import hashlib
import os
import platform
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import fields
from functools import lru_cache
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.errors import MeshError
from gdfe_ros.mesh.cells.filling import Filling
from gdfe_ros.mesh.mesh import HexMesh, Mesh
from gdfe_ros.mesh.tetmesh import TetMesh
from gdfe_ros.untrusted.regular_file import replace_file

_ROOM = Path(__file__).parents[1]
"""Folder of `gdfe_ros.mesh`."""
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
    with _refuse_damage("robot"):
        arrays = {key.replace(_SLASH, "/"): array for key, array in _unpack(text).items()}
        uris = [key.removeprefix(_VERTICES) for key in arrays if key.startswith(_VERTICES)]
        surfaces = {uri: (arrays[_VERTICES + uri], arrays[_TRIANGLES + uri]) for uri in uris}
        return arrays["urdf"].tobytes().decode(), surfaces


def unpack_mesh(text: str) -> Mesh:
    """Return the mesh that was given to `pack_mesh`.

    Raises:
        MeshError: the text is damaged, or is not a packed mesh.
    """
    with _refuse_damage("mesh"):
        return mesh_of(_unpack(text))


def mesh_of(arrays: dict[str, NDArray]) -> Mesh:
    """Return the mesh whose arrays `mesh_arrays` returned."""
    cells, filled = arrays["cells"], under(arrays, _FILLING)
    kind = TetMesh if np.ndim(cells) == 2 and np.shape(cells)[1] == TetMesh.nodes else HexMesh
    sets = under(arrays, _CELL_SET), under(arrays, _VERTEX_SET)
    return kind(arrays["vertices"], cells, *sets, Filling(**filled) if filled else None)


def under(named: Mapping[str, NDArray], head: str) -> dict[str, NDArray]:
    """Return the arrays whose names begin with ``head``, with this prefix removed from their names."""
    return {name.removeprefix(head): array for name, array in named.items() if name.startswith(head)}


def unpack_surface(text: str) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the vertices (n, 3) [m] and triangles (t, 3) that were given to `pack_surface`.

    Raises:
        MeshError: the text is damaged, or is not a packed surface.
    """
    with _refuse_damage("surface"):
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
def _refuse_damage(what: str) -> Iterator[None]:
    """Convert any error in the ``with`` block, which decodes a text, to MeshError."""
    try:
        yield
    except Exception as error:  # base64, zipfile, zlib and numpy raise many kinds of exceptions for damaged data
        text = f"damaged: {error}; remedy: read the scene from its file or bag again"
        raise MeshError(f"the embedded {what}", [text]) from error


MOST_BYTES = 256_000_000
"""Limit of the total size of the cached files [B]; the least recently used files are deleted first."""
_DIGEST = 32


def key_of(*parts: bytes) -> str:
    """Return the cache key of a result that is computed from ``parts``: a SHA-256 digest in hexadecimal."""
    digest = hashlib.sha256(_code())
    for part in parts:
        digest.update(len(part).to_bytes(8, "little") + part)
    return digest.hexdigest()


def recall(key: str) -> dict[str, NDArray] | None:
    """Return the arrays stored under a key; None if there are none, or if the file is damaged."""
    path = _folder() / f"{key}.npz"
    try:
        content = path.read_bytes()
        if hashlib.sha256(content[_DIGEST:]).digest() != content[:_DIGEST]:
            return None
        os.utime(path)
        archive = np.load(BytesIO(content[_DIGEST:]), allow_pickle=False)
    except OSError:
        return None
    return {name: archive[name] for name in archive.files}


def keep(key: str, arrays: Mapping[str, NDArray]) -> None:
    """Store arrays under a key. If the disk is full or read-only, nothing is stored, and no error is raised."""
    buffer = BytesIO()
    np.savez(buffer, **arrays)
    content, folder = buffer.getvalue(), _folder()
    with suppress(OSError):
        replace_file(folder / f"{key}.npz", hashlib.sha256(content).digest() + content)
        _tidy(folder)


def _tidy(folder: Path) -> None:
    """Delete the files used least recently until the total size is at most `MOST_BYTES`."""
    files = sorted(((item.stat().st_mtime, item.stat().st_size, item) for item in folder.iterdir()), reverse=True)
    total = 0
    for _, size, path in files:
        total += size
        if total > MOST_BYTES:
            path.unlink(missing_ok=True)


def _folder() -> Path:
    """Return the folder of the cached files: in numba's cache, in the package, or in the user's cache."""
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    if chosen:
        return Path(chosen) / "gdfe_ros_bodies"
    if os.access(_ROOM, os.W_OK):
        return _ROOM / "__pycache__" / "bodies"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "gdfe_ros" / "bodies"


@lru_cache(maxsize=1)
def _code() -> bytes:
    """Return a digest of the sources of `gdfe_ros.mesh`, of numpy's version and of the machine's architecture."""
    digest = hashlib.sha256(f"{np.__version__} {platform.machine()}".encode())
    for path in sorted(_ROOM.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.digest()

# SPDX-License-Identifier: Apache-2.0
"""Saving and restoring the whole state of a simulation; the steps after a restore are bitwise identical.

A checkpoint is a zip archive of numpy arrays (``.npz``) and two text files. ``head.json`` contains the format, the
package version, and data that identify the scene. ``state.json`` is the tree of `gdfe_ros.solver.state.State`; its
leaves are numbers, texts and names of arrays. Shapes and SI units are documented at the attributes of `State` and its
classes. Data that follow from the scene (mesh, operators, factored matrix) are left out. The simulation into which a
state is restored already has them. It must have the same scene, settings and package version.
"""

from __future__ import annotations

import hashlib
import io
import json
import struct
import zipfile
import zlib
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import gdfe_ros
from gdfe_ros.errors import GdfeError
from gdfe_ros.simulation import Simulation
from gdfe_ros.simulation_parts.state_tree import TreeError, from_tree, to_tree
from gdfe_ros.untrusted.bounded_text import load_json, load_json_object
from gdfe_ros.untrusted.regular_file import LARGEST, read_bytes, replace_file

FORMAT = 3
"""Version of the archive's format; an archive of another version is refused."""
_DAMAGED = (
    zipfile.BadZipFile, NotImplementedError, RuntimeError, LookupError, ValueError, TypeError, AttributeError, EOFError,
    OSError, OverflowError, MemoryError, RecursionError, struct.error, zlib.error, TreeError,
)  # fmt: skip
"""Exceptions that may occur while a damaged archive is read."""


def save_state(simulation: Simulation) -> bytes:
    """Return the state of a simulation as bytes; the simulation is not modified."""
    arrays: dict[str, NDArray[Any]] = {}
    tree = to_tree(replace(simulation.snapshot(), scene=""), arrays)
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr("head.json", json.dumps({"format": FORMAT, **_origin(simulation)}))
        archive.writestr("state.json", json.dumps(tree))
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as entry:
                np.lib.format.write_array(entry, np.ascontiguousarray(array), allow_pickle=False)
    return stream.getvalue()


def write_state(path: Path, data: bytes) -> None:
    """Write a state from `save_state` to a new file, or in place of a former state; no other file is overwritten.

    The file is replaced as a whole: if the disk is full, the former state stays.

    Raises:
        GdfeError: there is a file, a folder or another thing at the path that is no state.
        OSError: the file cannot be written.
    """
    if (path.is_symlink() or path.exists()) and not _is_state(path):
        raise GdfeError(f"{path} exists and is no state; allowed: a new file, or one that was written by save_state")
    replace_file(path, data)


def _is_state(path: Path) -> bool:
    """Return whether a regular file begins as a state does: as a zip archive, with the entry ``head.json``."""
    try:
        data = read_bytes(path)
    except OSError:
        return False
    return data[:4] == b"PK\3\4" and data[30:39] == b"head.json"


def load_state(simulation: Simulation, data: bytes) -> None:
    """Restore a saved state into a simulation.

    Raises:
        GdfeError: the data are not a state, or belong to another scene, settings or version; the simulation is
            unchanged.
    """
    try:
        archive = zipfile.ZipFile(io.BytesIO(data))
        size = sum(entry.file_size for entry in archive.infolist())
    except _DAMAGED as error:
        raise GdfeError(f"these {len(data)} bytes are not a state that save_state wrote") from error
    if size > LARGEST:
        raise GdfeError(f"the state has {size} bytes of data; allowed: up to {LARGEST}")
    try:
        given = load_json_object(archive.read("head.json"))
    except _DAMAGED as error:
        raise GdfeError(f"the state is damaged: {error!r}") from error
    own = {"format": FORMAT, **_origin(simulation)}
    wrong = [_difference(key, given.get(key), own[key]) for key in own if given.get(key) != own[key]]
    if wrong:
        raise GdfeError(f"the state does not fit: {'; '.join(wrong)}")
    try:
        tree = load_json(archive.read("state.json"))
        names = [name.removesuffix(".npy") for name in archive.namelist() if name.endswith(".npy")]
        files = {name: io.BytesIO(archive.read(f"{name}.npy")) for name in names}
        arrays = {name: np.lib.format.read_array(file, allow_pickle=False) for name, file in files.items()}
        snapshot = from_tree(tree, arrays)
    except _DAMAGED as error:
        raise GdfeError(f"the state is damaged: {error!r}") from error
    simulation.restore(replace(snapshot, scene=simulation.snapshot().scene))


def _difference(key: str, given: object, own: str) -> str:
    """Return a message about an entry of ``head.json`` that differs from the simulation's; digests are not printed."""
    if key != "scene":
        return f"its {key} is {given}, the simulation's {own}"
    remedy = "remedy: load it with the scene, the overrides and the files (meshes, skins) that it was saved with"
    return f"its scene has another text than the simulation's; {remedy}"


def _origin(simulation: Simulation) -> dict[str, str]:
    scene = hashlib.sha256(simulation.scene.source.encode()).hexdigest()
    settings = {**asdict(simulation.settings), "policy": simulation.policy.value}
    return {"version": gdfe_ros.__version__, "scene": scene, "settings": json.dumps(settings, sort_keys=True)}

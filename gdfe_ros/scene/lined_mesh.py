# SPDX-License-Identifier: Apache-2.0
"""Disk cache of bodies that are made from surfaces, so that loading a scene again does not fill the surfaces again."""

from __future__ import annotations

import json
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh import Mesh
from gdfe_ros.mesh.mesh_input import LARGEST
from gdfe_ros.mesh.outside import Outside
from gdfe_ros.mesh.packing import mesh_arrays, mesh_of
from gdfe_ros.mesh.store import keep, key_of, recall
from gdfe_ros.mesh.touching import Touching
from gdfe_ros.regular_file import read_bytes
from gdfe_ros.scene.mesh_schema import MeshModel
from gdfe_ros.scene.skin_schema import SkinModel

Entries = tuple[dict[str, Any] | None, dict[str, Any] | None]
"""Scene entries of a mesh and of its skin, with the contents of their files; None for an entry without a file."""
_MESH, _SKIN, _TOUCHING, _ENTRIES = "mesh:", "skin:", "touching:", "entries"
_CONTACT = ("corners", "weights", "faces", "vertices")


class BodyStore:
    """Cache of one body on disk; its key is computed from the body's entries and the contents of its files.

    Bodies that differ only in their pose share an entry: a left and a right finger of one file are made once.

    Args:
        model: scene entry of the mesh.
        skin: scene entry of its skin; None for a mesh without a skin.
    """

    def __init__(self, model: MeshModel, skin: SkinModel | None) -> None:
        slow = skin is not None or model.voxels is not None
        content = [_content(each) for each in (model, skin) if each is not None]
        self._pose = model.pose
        # A mesh file may include other files, whose contents are not known here.
        self._key = None if not slow or model.file is not None or None in content else key_of(*content)

    def recall(self) -> tuple[Mesh, Entries] | None:
        """Return the cached body and its entries; None if they are not cached."""
        arrays = recall(self._key) if self._key is not None else None
        if arrays is None:
            return None
        first, second = json.loads(str(arrays[_ENTRIES]))
        first = first and {"embedded": first["embedded"], **self._pose}
        mesh = mesh_of(_under(arrays, _MESH))
        drawn, touching = _under(arrays, _SKIN), _under(arrays, _TOUCHING)
        skin = Outside(**drawn) if drawn else None
        return replace(mesh, skin=skin, touching=Touching(**touching, surface=skin) if touching else None), (
            first,
            second,
        )

    def keep(self, mesh: Mesh, entries: Entries) -> None:
        """Store the body and its entries on disk, if this body can be cached."""
        if self._key is None:
            return
        arrays = {_MESH + name: array for name, array in mesh_arrays(mesh).items()}
        if mesh.skin is not None:
            arrays |= {_SKIN + item.name: getattr(mesh.skin, item.name) for item in fields(Outside)}
        if mesh.touching is not None:
            arrays |= {_TOUCHING + name: getattr(mesh.touching, name) for name in _CONTACT}
        keep(self._key, {**arrays, _ENTRIES: np.array(json.dumps(entries))})


def _under(arrays: dict[str, NDArray], head: str) -> dict[str, NDArray]:
    return {name.removeprefix(head): array for name, array in arrays.items() if name.startswith(head)}


def _content(model: MeshModel | SkinModel) -> bytes | None:
    """Return an entry and the contents of its files as bytes; None if a file cannot be read."""
    exclude = {"skin", "mirror", "at", "rotation_deg"} & type(model).model_fields.keys()
    text = [json.dumps(model.model_dump(mode="json", exclude=exclude), sort_keys=True).encode()]
    for path in _paths(model):
        try:
            text.append(read_bytes(path, most=LARGEST))
        except OSError:
            return None
    return b"\0".join(text)


def _paths(model: MeshModel | SkinModel) -> list[Path]:
    values = [value for _, value in model] + [value for _, value in getattr(model, "voxels", None) or ()]
    return [value for value in values if isinstance(value, Path)]

# SPDX-License-Identifier: Apache-2.0
"""Construction of the simulated mesh from `mesh` or `meshes`; slow results are cached on disk."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from dataclasses import fields, replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from gdfe_ros.errors import MeshError, show_point
from gdfe_ros.mesh import Mesh, TetMesh, require_sound
from gdfe_ros.mesh.assembly import assemble
from gdfe_ros.mesh.files.mesh_input import LARGEST
from gdfe_ros.mesh.files.stored_mesh import keep, key_of, mesh_arrays, mesh_of, pack_mesh, recall, under
from gdfe_ros.mesh.mesh import MeshPart
from gdfe_ros.mesh.outside import Outside
from gdfe_ros.mesh.overlap import find_overlap
from gdfe_ros.mesh.tetmesh import divide
from gdfe_ros.mesh.touching import Touching
from gdfe_ros.scene.document import Carried, KeyPath, without
from gdfe_ros.scene.report import Defects, Unfit, require_known
from gdfe_ros.scene.schemas.mesh_schema import MeshModel, PlacedMeshModel, SkinModel
from gdfe_ros.scene.schemas.scene_schema import Draft
from gdfe_ros.untrusted.regular_file import read_bytes

Texts = tuple[str | None, str | None]
"""Packed mesh and packed skin as text; None for a generated mesh, and without a skin."""
_MESH, _SKIN, _TOUCHING, _TEXTS = "mesh:", "skin:", "touching:", "texts"
_OF_FILES = ("file", "voxels", "tets", "embedded", "scale", "merge", "first_order")
"""Keys of a mesh's or skin's entry that the key `embedded`, with the contents of the files, replaces."""
_CONTACT = ("corners", "weights", "faces", "vertices")
"""Fields of `Touching` that are stored in the cache."""


class BodyStore:
    """Cache of one body on disk, whose key is computed from the body's entries and the contents of its files.

    Bodies that differ only in their pose share one place: a left and a right finger of one file are computed once.

    Args:
        model: scene entry of the mesh.
        skin: scene entry of its skin; None for a mesh without a skin.
    """

    def __init__(self, model: MeshModel, skin: SkinModel | None) -> None:
        # Mesh files are not cached: they may include other files, whose changes would not be noticed.
        slow = model.file is None and (skin is not None or model.voxels is not None)
        content = [_content(each) for each in (model, skin) if each is not None] if slow else [None]
        self._key = None if None in content else key_of(*content)

    def recall(self) -> tuple[Mesh, Texts] | None:
        """Return the cached body and its texts; None if they are not cached."""
        arrays = recall(self._key) if self._key is not None else None
        if arrays is None:
            return None
        drawn, touching = under(arrays, _SKIN), under(arrays, _TOUCHING)
        skin = Outside(**drawn) if drawn else None
        contact = Touching(**touching, surface=skin) if touching else None
        mesh = replace(mesh_of(under(arrays, _MESH)), skin=skin, touching=contact)
        return mesh, tuple(json.loads(str(arrays[_TEXTS])))

    def keep(self, mesh: Mesh, texts: Texts) -> None:
        """Store the body and its texts on disk, if this body can be cached."""
        if self._key is None:
            return
        arrays = {_MESH + name: array for name, array in mesh_arrays(mesh).items()}
        if mesh.skin is not None:
            arrays |= {_SKIN + item.name: getattr(mesh.skin, item.name) for item in fields(Outside)}
        if mesh.touching is not None:
            arrays |= {_TOUCHING + name: getattr(mesh.touching, name) for name in _CONTACT}
        keep(self._key, {**arrays, _TEXTS: np.array(json.dumps(texts))})


def _content(model: MeshModel | SkinModel) -> bytes | None:
    """Return an entry and the contents of its files as bytes; None if a file cannot be read."""
    own = model.model_dump(mode="json", exclude={"skin", "mirror", "at", "rotation_deg"})
    text = [json.dumps(own, sort_keys=True).encode()]
    for path in _paths(model):
        try:
            text.append(read_bytes(path, most=LARGEST))
        except OSError:
            return None
    return b"\0".join(text)


def _paths(model: MeshModel | SkinModel) -> list[Path]:
    values = [value for _, value in model] + [value for _, value in getattr(model, "voxels", None) or ()]
    return [value for value in values if isinstance(value, Path)]


def require_body(data: Mapping[str, Any], report: Defects) -> None:
    """Report a defect if a scene has no body, both `mesh` and `meshes`, or `skin` with `meshes`."""
    if "meshes" in data and "mesh" in data:
        text = "`mesh` is there, too; remedy: keep one of the two; `meshes` may contain a single body"
        report.refuse(("meshes",), text)
    elif data.get("meshes") == {}:
        report.add(("meshes",), "there is no mesh; give e.g. {left: {bar: {...}, at: [0, 0.05, 0]}, right: ...}")
    elif "meshes" not in data and data.get("mesh") is None:
        text = "needed: the body, e.g. bar: {size: [0.2, 0.05, 0.05], cells: [20, 5, 5]}; or `meshes`"
        report.refuse(("mesh",), f"{'is empty' if 'mesh' in data else 'is missing'}; {text}")
    if "meshes" in data and "skin" in data:
        report.refuse(("skin",), "remedy: put it into its mesh, as meshes: {left: {..., skin: {file: ...}}}")


def build_mesh(draft: Draft, carried: Carried, report: Defects) -> Mesh | None:
    """Return the mesh of a scene with its skin; None if it has defects."""
    names = report.names("meshes")
    if not names:
        paths = ("mesh",), ("skin",)
        return None if draft.mesh is None else _body(draft.mesh, draft.skin, paths, carried, report)
    made = {name: build_part(model, ("meshes", name), carried, report) for name, model in draft.meshes.items()}
    parts = {name: part for name, part in made.items() if part is not None}
    if any(isinstance(part.mesh, TetMesh) for part in parts.values()):
        parts = {name: of_tetrahedra(("meshes", name), part, report) for name, part in parts.items()}
    require_apart(parts, "meshes", report)
    return assemble(parts) if len(parts) == len(names) else None


def build_part(model: PlacedMeshModel, path: KeyPath, carried: Carried, report: Defects) -> MeshPart | None:
    """Return the mesh of the entry at ``path`` with its skin and its pose; None if it has defects."""
    mesh = _body(model, model.skin, (path, (*path, "skin")), carried, report)
    return None if mesh is None else model.place_part(mesh)


def of_tetrahedra(path: KeyPath, part: MeshPart, report: Defects) -> MeshPart:
    """Return a mesh as tetrahedra: hexahedra are divided, and a skin or cut cells of hexahedra are defects."""
    mesh = part.mesh
    if isinstance(mesh, TetMesh):
        return part
    lost = ["cut cells"] * (mesh.filling is not None) + ["a skin"] * (mesh.skin is not None)
    if lost:
        text = (
            f"other meshes of this scene have tetrahedra, and these hexahedra have {' and '.join(lost)}; "
            "remedy: tets: {surface: ..., size: ...} for this mesh"
        )
        report.refuse(path, text)
    return replace(part, mesh=divide(mesh))


def _body(
    model: MeshModel, skin: SkinModel | None, paths: tuple[KeyPath, KeyPath], carried: Carried, report: Defects
) -> Mesh | None:
    """Return a mesh with its skin, in its own frame; None if it has defects.

    ``paths`` are the key paths of the mesh and of its skin. Entries with the contents of their files are added to
    ``carried``.
    """
    store = BodyStore(model, skin)
    mesh, texts = store.recall() or _compute(model, skin, store, paths, report)
    for path, text in zip(paths, texts, strict=True):
        if text is not None:
            carried[path] = without(report.value_at(path, plain=False), *_OF_FILES) | {"embedded": text}
    return None if mesh is None else model.reflect(mesh)


def _compute(
    model: MeshModel, skin: SkinModel | None, store: BodyStore, paths: tuple[KeyPath, KeyPath], report: Defects
) -> tuple[Mesh | None, Texts]:
    """Compute a mesh with its skin, and keep it in ``store``; return the mesh and its `Texts`."""
    try:
        mesh = model.build()
        require_sound(mesh, "mesh")
    except MeshError as error:
        report.add_all((*paths[0], *model.place), error)
        return None, (None, None)
    texts = pack_mesh(mesh) if model.reads else None, None
    if skin is not None and isinstance(mesh, TetMesh):
        report.refuse(paths[1], "tetrahedra follow the surface themselves; remedy: remove the skin")
        return mesh, texts
    try:
        if skin is not None:
            mesh, surface = skin.build(mesh)
            texts = texts[0], surface
        store.keep(mesh, texts)
    except MeshError as error:
        report.add_all((*paths[1], skin.chosen[0]), error)
    return mesh, texts


def require_apart(
    parts: Mapping[str, MeshPart], section: str, report: Defects, *, among: Collection[str] | None = None
) -> None:
    """Report meshes that overlap in the undeformed configuration, as defects of the entries of ``section``.

    Only pairs with the second mesh in ``among`` are examined; None examines all pairs.
    """
    placed = {name: part.place() for name, part in parts.items()}
    for first, second in combinations(placed, 2):
        if among is not None and second not in among:
            continue
        found = find_overlap(placed[first], placed[second])
        if found is not None:
            text = (
                f"mesh {second!r} lies in mesh {first!r} initially, {found.depth:.3g} m deep or more near "
                f"{show_point(found.point)} m; remedy: move or turn one of them, by at and rotation_deg"
            )
            report.add((section, second, "at"), text)


def require_part(mesh: Mesh, name: str | None, key: str = "mesh") -> None:
    """Raise `Unfit` if no mesh has the ``name`` that an entry gives at ``key``; None, no name, is valid."""
    if name is not None and not mesh.parts:
        text = "the one `mesh` of this scene has no name; remedy: leave this key out, or give `meshes` by name"
        raise Unfit(key, text)
    if name is not None:
        require_known(key, "mesh", name, mesh.parts)

# SPDX-License-Identifier: Apache-2.0
"""Construction of chambers from the valid parts of a scene file: the faces on which their pressure acts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators import Chamber, Embedding
from gdfe_ros.actuators.load import corner_areas
from gdfe_ros.constraints import Handle
from gdfe_ros.errors import show_point
from gdfe_ros.mesh import HexMesh, select_faces
from gdfe_ros.mesh.cavities import Cavity, close_on, find_cavities, inside_volume, skin_cavities
from gdfe_ros.mesh.cells.faces import reverse
from gdfe_ros.mesh.outside import Outside
from gdfe_ros.mesh.quality import list_ids
from gdfe_ros.scene.building.builder import select
from gdfe_ros.scene.building.simulated_mesh import require_part
from gdfe_ros.scene.report import NO_VALUE, Unfit
from gdfe_ros.scene.schemas.actuator_schema import ChamberModel


def build_chamber(value: ChamberModel, mesh: HexMesh, handles: Sequence[Handle], common: dict) -> Chamber:
    """Return the chamber of an entry; openings of the faces in `where` are closed if their rims are on handles.

    Raises:
        Unfit: the cavity does not exist, or the faces enclose no chamber.
    """
    require_part(mesh, value.mesh)
    part = None if value.mesh is None else mesh.parts[value.mesh]
    within, first = (mesh, 0) if part is None else (part.mesh, part.first_vertex)
    if within.filling is not None:
        return _make_skin_chamber(value, within, first, common)
    if value.where is not None:
        return _make_chamber(mesh, reverse(select(select_faces, mesh, value.where, "boundary face")), handles, common)
    body = "the body" if part is None else f"mesh {value.mesh!r}"
    lack = f"{body} has no closed cavity; remedy: name its faces by `where`; `gdfe inspect` shows leaks"
    cavity = _choose(value, find_cavities(within), body, lack)
    return Chamber(quads=cavity.quads + np.int32(first), **common)


def _make_skin_chamber(value: ChamberModel, mesh: HexMesh, first: int, common: dict) -> Chamber:
    """Return a chamber whose pressure acts on the skin, because the faces of cut cells are not on the surface."""
    if value.where is not None:
        text = "it would name faces of cut cells, which lie beside the surface; remedy: cavity, near, or cells: whole"
        raise Unfit("where", text, value=NO_VALUE)
    if mesh.skin is None:
        text = "with cut cells, its pressure acts on the skin; remedy: `skin: {file: ...}` with the mesh's surface, "
        raise Unfit("", f"{text}or cells: whole", value=NO_VALUE)
    lack = "the skin has no closed shell within another one; remedy: a skin with the chamber's walls, closed"
    points, quads = on_skin(mesh.skin, _choose(value, skin_cavities(mesh), "the skin", lack).quads)
    return Chamber(quads=quads, points=replace(points, corners=points.corners + first), **common)


def on_skin(skin: Outside, quads: NDArray[np.int32]) -> tuple[Embedding, NDArray[np.int32]]:
    """Return the material points at the corners of some faces of a skin, and the faces as indices into these points.

    ``quads`` (q, 3 or 4) are the faces as indices into all points of the skin.
    """
    used, local = np.unique(quads, return_inverse=True)
    return Embedding(skin.corners[used], skin.weights[used]), local.reshape(quads.shape).astype(np.int32)


def _choose(value: ChamberModel, cavities: Sequence[Cavity], body: str, lack: str) -> Cavity:
    """Return the cavity to which an entry refers; raise `Unfit` if it refers to none or to several.

    ``body`` is the name of the body in messages, and ``lack`` the message for a body without cavities.
    """
    known = ", ".join(f"{i}: {c.volume:.3g} m^3 near {np.round(c.center, 6).tolist()}" for i, c in enumerate(cavities))
    if not cavities:
        raise Unfit("", lack)
    if value.near is not None:
        centers = np.array([cavity.center for cavity in cavities])
        return cavities[int(np.linalg.norm(centers - value.near, axis=1).argmin())]
    if value.cavity is None and len(cavities) > 1:
        raise Unfit("", f"{body} has {len(cavities)} cavities ({known}); remedy: name one by cavity or near")
    if (value.cavity or 0) >= len(cavities):
        raise Unfit("cavity", f"there are: {known}")
    return cavities[value.cavity or 0]


def _closes(handle: Handle) -> bool:
    """Return whether a plate between vertices of a handle stays flat: the handle is rigid, or a plane of symmetry."""
    return handle.section == Handle.section and (handle.slide is None or len(handle.free) == 2)


def _make_chamber(mesh: HexMesh, quads: NDArray[np.int32], handles: Sequence[Handle], common: dict) -> Chamber:
    """Return the chamber of given faces; plates close openings whose rim is on one handle, or on fixed handles."""
    holder = np.full(len(mesh.vertices), -1, dtype=np.int32)
    for number, handle in enumerate(filter(_closes, handles)):
        holder[handle.vertices] = 0 if handle.fixed and handle.slide is None else number + 1
    plates, leaks = close_on(quads, holder)
    if len(leaks):
        place = show_point(mesh.vertices[leaks[0]].mean(axis=0))
        text = (
            f"these {len(quads)} faces leak at {len(leaks)} edges, the first at {place} m between "
            f"vertices {list_ids(np.unique(leaks))}; remedy: select every face of the chamber, close its ends, or hold "
            "each open end by one handle"
        )
        raise Unfit("where", text, value=NO_VALUE)
    if len(plates):
        least = float(corner_areas(mesh.vertices, quads).sum()) ** 1.5
        return Chamber(quads=np.concatenate([quads, plates]), least=least, **common)
    if inside_volume(mesh.vertices, quads) <= 0.0:
        text = "these faces enclose the body itself, not a chamber in it; select inner faces"
        raise Unfit("where", text, value=NO_VALUE)
    return Chamber(quads=quads, **common)

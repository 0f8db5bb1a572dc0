# SPDX-License-Identifier: Apache-2.0
"""Transfer of a motion to a body of the same shape with other materials, or to a scene with other free bodies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints import Handle
from gdfe_ros.constraints.rigid_body import rigid_among
from gdfe_ros.solver.motion import inertia, viscosity
from gdfe_ros.solver.state import ElementState, Saved, Snapshot, replace_fields

_Value = TypeVar("_Value")


def carry_motion(moving: Snapshot, fresh: Snapshot) -> Snapshot:
    """Return a snapshot that continues a motion with other materials and the same positions, velocities and commands.

    The states of elements and minimisations belong to the old materials. They are replaced by the states of ``fresh``.
    No vertex counts as at rest, because the forces have changed. The energy account ignores the change of energy.

    Args:
        moving: snapshot of the body with the old materials.
        fresh: snapshot of the undeformed body with the new materials.
    """
    old, new = moving.state, fresh.state
    state = old.with_(
        elements=new.elements,
        tangent=new.tangent,
        unfinished=None,
        summary=replace_fields(old.summary, converged=False),
        ledger=replace_fields(old.ledger, failure=None, bound=None),
    )
    return replace(moving, state=state, scene=fresh.scene)


@dataclass(frozen=True, eq=False, kw_only=True)
class Correspondence:
    """Old indices of the parts of a new scene; -1 marks a part that the old scene does not have.

    Attributes:
        vertices: (n,) old index of each vertex, those of rigid bodies included.
        cells: (m,) old index of each cell.
        materials: (k,) old index of each material.
        loose: (p,) old index of each freely moving part of the handles.
    """

    vertices: NDArray[np.intp]
    cells: NDArray[np.intp]
    materials: NDArray[np.intp]
    loose: NDArray[np.intp]


CHANGED = "bodies joined or left, and no step has been made since"


def with_bodies_of(moving: Snapshot, fresh: Snapshot, same: Correspondence) -> Snapshot:
    """Return a snapshot that continues a motion in a scene that differs in its rigid bodies and soft bodies only.

    Parts that are in both scenes continue their motion. A new body is at rest in its rest pose, as in ``fresh``.
    If soft bodies came or went, contacts with the soft bodies start without a force: the next step finds the forces.

    Args:
        moving: snapshot in the old scene.
        fresh: snapshot in the new scene before its first step.
        same: old indices of the parts of the new scene.
    """
    before, start = moving.state, fresh.state
    terms = {name: _continue(before.terms.get(name), own) for name, own in start.terms.items()}
    old, own = before.terms[inertia.NAME], start.terms[inertia.NAME]
    terms[inertia.NAME] = {
        name: array if len(array) == 1 else _take(array, own[name], same.vertices) for name, array in old.items()
    }
    if viscosity.NAME in terms:
        terms[viscosity.NAME] = _carry_viscosity(before.terms[viscosity.NAME], start.terms[viscosity.NAME], same.cells)
    flawed = before.with_flaw(CHANGED, reactions=_keep_known(before.summary.reactions, start.summary.reactions))
    state = flawed.with_(
        positions=_take(before.positions, start.positions, same.vertices),
        base=_take(before.base, start.base, same.vertices),
        poses=_keep_known(before.poses, start.poses),
        slides=_take(before.slides, start.slides, same.loose),
        turns=_take(before.turns, start.turns, same.loose),
        motion=None,
        terms=terms,
        elements=_carry_elements(before.elements, start.elements, same),
        operators=start.operators,
        tangent=start.tangent,
        unfinished=None,
        proved=None,
        anchor=None,
        ledger=replace_fields(before.ledger, failure=None, bound=None),
    )
    return replace(moving, state=state, targets=_keep_known(moving.targets, fresh.targets), scene=fresh.scene)


def _continue(old: Saved | None, own: Saved) -> Saved:
    """Return a term's stored state for the new scene.

    This is ``old`` if its arrays have the shapes of ``own``. Otherwise it is ``own`` with the dissipated energy of
    ``old``.
    """
    if old is None:
        return own
    if all(np.shape(old.get(name, array)) == np.shape(array) for name, array in own.items()):
        return old
    return {**own, "lost": old["lost"]} if "lost" in old else own


def _carry_viscosity(old: Saved, own: Saved, cells: NDArray[np.intp]) -> Saved:
    """Return the stored viscous strains at the new indices of their cells; a new cell is undeformed."""
    each = len(own["strain"]) // len(cells)
    rows = np.where(cells[:, None] < 0, -1, each * cells[:, None] + np.arange(each)).ravel()
    found = {name: _take(old[name], own[name], rows) for name in ("strain", "before")}
    pairs = zip(old["branches"], own["branches"], strict=True)
    branches = [_take(held, fresh, rows) for held, fresh in pairs]
    return {**old, **found, "branches": np.array(branches).reshape(own["branches"].shape)}


def _carry_elements(old: ElementState, new: ElementState, same: Correspondence) -> ElementState:
    """Return the state of the elements, with the values of ``old`` in the cells and materials that ``old`` has."""
    rows = {field.name: same.materials if field.name == "bulk" else same.cells for field in fields(ElementState)}
    return ElementState(**{name: _take(getattr(old, name), getattr(new, name), rows[name]) for name in rows})


def match_vertices(
    old: Sequence[Handle], new: Sequence[Handle], parts: NDArray[np.intp], count: int
) -> NDArray[np.intp]:
    """Return the old index of each of ``count`` vertices; -1 if ``old`` does not have it.

    ``parts`` (n,) are the old indices of the soft bodies' vertices. The vertices of rigid bodies follow them.
    """
    known = {body.name: body.vertices for body in rigid_among(old)}
    rows = np.concatenate([parts, np.full(count - len(parts), -1)])
    for body in rigid_among(new):
        rows[body.vertices] = known.get(body.name, -1)
    return rows


def match_loose(old: Sequence[Handle], new: Sequence[Handle]) -> NDArray[np.intp]:
    """Return the old index of each freely moving part of the handles ``new``; -1 if ``old`` does not have it."""
    before, after = _loose(old), _loose(new)
    return np.array([before.index(name) if name in before else -1 for name in after], dtype=np.intp)


def _loose(handles: Sequence[Handle]) -> list[tuple[str, int]]:
    """Return the name of each freely moving part of the handles, with its number within the handle."""
    pieces = [(handle.name, k, piece) for handle in handles for k, piece in enumerate(handle.pieces)]
    return [(name, k) for name, k, piece in pieces if piece.loose]


def _take(old: NDArray[np.float64], new: NDArray[np.float64], rows: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return ``new`` with the rows of ``old`` whose indices are in ``rows``; -1 keeps a row of ``new``."""
    found, kept = new.copy(), rows >= 0
    found[kept] = old[rows[kept]]
    return found


def _keep_known(old: Mapping[str, _Value], new: Mapping[str, _Value]) -> dict[str, _Value]:
    """Return the entries of ``new``, with the values of ``old`` where it has them."""
    return {name: old.get(name, value) for name, value in new.items()}

# SPDX-License-Identifier: Apache-2.0
"""Transfer of a motion to a body of the same shape with other materials, or to a scene with other rigid bodies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints import Handle
from gdfe_ros.constraints.rigid_body import rigid_among
from gdfe_ros.solver.motion import inertia
from gdfe_ros.solver.state import Saved, Snapshot
from gdfe_ros.solver.value import changed

_Value = TypeVar("_Value")


def carried(moving: Snapshot, fresh: Snapshot) -> Snapshot:
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
        summary=changed(old.summary, converged=False),
        ledger=changed(old.ledger, failure=None, bound=None),
    )
    return replace(moving, state=state, scene=fresh.scene)


def with_bodies_of(moving: Snapshot, fresh: Snapshot, old: Sequence[Handle], new: Sequence[Handle]) -> Snapshot:
    """Return a snapshot that continues a motion in a scene that differs in its rigid bodies only.

    Bodies of both scenes, the soft body, the contacts between them and the arms continue. A new body is at rest in its
    rest pose, as in ``fresh``.

    Args:
        moving: snapshot in the old scene.
        fresh: snapshot in the new scene before its first step.
        old: handles, obstacles and rigid bodies of the old scene.
        new: those of the new scene.
    """
    before, start = moving.state, fresh.state
    rows = _rows(old, new, len(start.positions))
    loose = _matches(_loose(old), _loose(new))
    terms = _known(before.terms, start.terms)
    terms[inertia.NAME] = _moved_rows(before.terms[inertia.NAME], start.terms[inertia.NAME], rows, len(start.positions))
    state = before.with_(
        positions=_taken(before.positions, start.positions, rows),
        base=_taken(before.base, start.base, rows),
        poses=_known(before.poses, start.poses),
        slides=_taken(before.slides, start.slides, loose),
        turns=_taken(before.turns, start.turns, loose),
        motion=None,
        terms=terms,
        tangent=start.tangent,
        unfinished=None,
        proved=None,
        anchor=None,
        summary=changed(
            before.summary, converged=False, reactions=_known(before.summary.reactions, start.summary.reactions)
        ),
        ledger=changed(before.ledger, failure=None, bound=None),
    )
    return replace(moving, state=state, targets=_known(moving.targets, fresh.targets), scene=fresh.scene)


def _rows(old: Sequence[Handle], new: Sequence[Handle], count: int) -> NDArray[np.intp]:
    """Return the old index of each of ``count`` vertices, or -1 for those of a new rigid body."""
    known = {body.name: body.vertices for body in rigid_among(old)}
    rows = np.arange(count)
    for body in rigid_among(new):
        rows[body.vertices] = known.get(body.name, -1)
    return rows


def _loose(handles: Sequence[Handle]) -> list[tuple[str, int]]:
    """Return the name of each freely moving part of the handles, with its number within the handle."""
    pieces = [(handle.name, k, piece) for handle in handles for k, piece in enumerate(handle.pieces)]
    return [(name, k) for name, k, piece in pieces if piece.loose]


def _matches(old: Sequence[tuple[str, int]], new: Sequence[tuple[str, int]]) -> NDArray[np.intp]:
    return np.array([old.index(name) if name in old else -1 for name in new], dtype=np.intp)


def _taken(old: NDArray[np.float64], new: NDArray[np.float64], rows: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return ``new`` with the rows of ``old`` whose indices are in ``rows``; -1 keeps a row of ``new``."""
    found, kept = new.copy(), rows >= 0
    found[kept] = old[rows[kept]]
    return found


def _moved_rows(old: Saved, new: Saved, rows: NDArray[np.intp], count: int) -> Saved:
    """Return the stored inertia ``old`` with other rows: a row that -1 marks has the rest position and no motion."""
    found = {}
    for name, array in old.items():
        if len(array) > 1:
            rest = new["positions"] if name in ("positions", "before") else np.zeros((count, *array.shape[1:]))
            array = _taken(array, rest, rows)
        found[name] = array
    return found


def _known(old: Mapping[str, _Value], new: Mapping[str, _Value]) -> dict[str, _Value]:
    """Return the entries of ``new``, with the values of ``old`` where it has them."""
    return {name: old.get(name, value) for name, value in new.items()}

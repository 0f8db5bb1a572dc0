# SPDX-License-Identifier: Apache-2.0
"""Teleport of free bodies during a motion."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints import Pose
from gdfe_ros.constraints.overlap import inside_surface, overlaps, placed_now
from gdfe_ros.errors import OverlapError
from gdfe_ros.mesh.tet_faces import flat_quads
from gdfe_ros.mesh.touching import outline
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.forces.actuation import Actuation
from gdfe_ros.solver.handle_motions import HandleMotions
from gdfe_ros.solver.motion import inertia, viscosity
from gdfe_ros.solver.state import Saved, State
from gdfe_ros.solver.value import changed

UNTOLD = "bodies were moved to other places, and no step has been made since"


def put_elsewhere(
    body: Body, handles: HandleMotions, actuation: Actuation, state: State, places: Mapping[str, Pose]
) -> State:
    """Return ``state`` with the rigid bodies of ``places`` at other poses and without velocity.

    ``places`` is a dict from body name to pose, relative to the body's rest pose.
    """
    vertices = vertices_of(body, places)
    slides, turns = handles.put(state.slides, state.turns, places)
    positions = state.positions.copy()
    positions[vertices] = handles.placed(state.base, slides, turns)[vertices]
    return stopped_at(body, actuation, state.with_(slides=slides, turns=turns), vertices, positions)


def stopped_at(
    body: Body, actuation: Actuation, state: State, vertices: NDArray[np.int32], positions: NDArray[np.float64]
) -> State:
    """Return ``state`` with ``vertices`` at their rows of ``positions`` (n, 3) [m] and without velocity.

    The vertices are all those of some free bodies, which have moved rigidly, so that strains are as before.
    """
    terms, places = dict(state.terms), positions[vertices]
    for contact in actuation.contacts:
        if np.isin(contact.vertices, vertices).any():
            terms[contact.name] = {**contact.neutral(), "lost": terms[contact.name]["lost"]}
    if terms[inertia.NAME]["h"][0]:
        still = dict.fromkeys(("velocity", "velocity_before", "acceleration", "balanced", "pushed"), 0.0)
        terms[inertia.NAME] = _with_rows(terms[inertia.NAME], vertices, positions=places, before=places, **still)
    if viscosity.NAME in terms:
        saved, cells = terms[viscosity.NAME], np.isin(body.cells[:, 0], vertices)
        rows = np.repeat(cells, len(saved["strain"]) // len(cells))
        terms[viscosity.NAME] = _with_rows(saved, rows, before=saved["strain"][rows])
    ledger = changed(state.ledger, failure=None)
    return state.flawed(UNTOLD).with_(positions=positions, terms=terms, motion=None, tangent=None, ledger=ledger)


def require_free(body: Body, state: State, names: Collection[str]) -> None:
    """Raise OverlapError if a rigid body in ``names`` is inside of an obstacle, another body, or the soft body."""
    placed = placed_now(body.handles, state.poses, state.positions)
    surface = outline(flat_quads(body.cell_type.boundary(body.cells).quads), body.skin, state.positions)
    found = list(overlaps(placed, names))
    found += [inside_surface(one, *surface) for one in placed if one.thing.name in names]
    if any(found):
        raise OverlapError("; ".join(text for text in found if text))


def pulled(state: State, vertices: NDArray[np.int32], acceleration: NDArray[np.float64]) -> State:
    """Return ``state`` in which ``vertices`` have these rows of ``acceleration`` (n, 3) [m/s^2], but no velocity yet.

    The previous step is the one that a motion with this constant acceleration would have had.
    """
    saved, pull = state.terms[inertia.NAME], acceleration[vertices]
    h, places = float(saved["h"][0]), saved["positions"][vertices]
    last = {"before": places + 0.5 * h * h * pull, "velocity_before": -h * pull}
    kept = _with_rows(saved, vertices, acceleration=pull, balanced=pull, **last)
    return state.with_(terms={**state.terms, inertia.NAME: kept})


def vertices_of(body: Body, places: Collection[str]) -> NDArray[np.int32]:
    """Return the vertices of the rigid bodies whose names are in ``places``."""
    return np.concatenate([each.vertices for each in body.rigid_bodies if each.name in places])


def _with_rows(saved: Saved, rows: NDArray[np.generic], **values: NDArray[np.float64] | float) -> Saved:
    """Return a stored state of a term with other ``values`` in some rows of its arrays."""
    kept = dict(saved)
    for name, value in values.items():
        kept[name] = saved[name].copy()
        kept[name][rows] = value
    return kept

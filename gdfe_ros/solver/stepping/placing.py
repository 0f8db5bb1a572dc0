# SPDX-License-Identifier: Apache-2.0
"""A state at given positions, from which steps go on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.errors import CommandError
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.elements.measures import least_volume_ratio
from gdfe_ros.solver.handle_motions import HandleMotions
from gdfe_ros.solver.state import State
from gdfe_ros.solver.value import changed


def placed(body: Body, handles: HandleMotions, state: State, positions: NDArray[np.float64], *, afresh: State) -> State:
    """Return a state at ``positions`` (n, 3) [m] in which handles are where they are commanded.

    Args:
        body: the discretised body.
        handles: the kinematics of its handles.
        state: whose commands and growth stay.
        positions: of all vertices; those that handles hold are not read.
        afresh: the state at rest, whose pressures, captured shapes and motion it has.
    """
    moved = positions.copy()
    slides, turns = handles.fit(moved, state.base)
    for handle in body.handles:
        if not (handle.free or handle.turning):
            moved[handle.vertices] = state.base[handle.vertices]
    least = float(least_volume_ratio(moved, state.operators.shape))
    return afresh.with_(
        positions=moved,
        base=state.base,
        poses=state.poses,
        commands=state.commands,
        slides=slides,
        turns=turns,
        operators=state.operators,
        balance=None,
        summary=changed(state.summary, converged=False, min_det=least),
        sound=least > 0.0,
    )


def require_own(state: State, own: State) -> None:
    """Refuse a state of another body.

    Args:
        state: that is to be gone on from.
        own: the body's state at rest.

    Raises:
        CommandError: vertices, handles, commands or terms are others.
    """
    for what, one, two in (
        ("vertices", len(state.positions), len(own.positions)),
        ("handles", sorted(state.poses), sorted(own.poses)),
        ("actuators and loads", sorted(state.commands), sorted(own.commands)),
        ("terms", sorted(state.terms), sorted(own.terms)),
    ):
        if one != two:
            raise CommandError(f"the state is one of another scene: its {what} are {one}, here {two}")

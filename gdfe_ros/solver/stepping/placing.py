# SPDX-License-Identifier: Apache-2.0
"""A state at given positions, from which steps go on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

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

# SPDX-License-Identifier: Apache-2.0
"""States at positions that a user sets, from which steps continue."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.body import Body
from gdfe_ros.solver.elements.measures import least_volume_ratio
from gdfe_ros.solver.handle_motions import HandleMotions
from gdfe_ros.solver.state import State
from gdfe_ros.solver.value import changed


def placed(body: Body, handles: HandleMotions, state: State, positions: NDArray[np.float64], *, afresh: State) -> State:
    """Return a state at ``positions`` (n, 3) [m] with the handles at their commanded poses.

    Args:
        body: the discretised body.
        handles: the kinematics of its handles.
        state: the state from which the commands and the growth are taken.
        positions: positions of all vertices; a handle without free axes keeps its commanded positions, and the free
            motion of any other handle is fitted.
        afresh: the undeformed state, from which the initial pressures, captured shapes and motion are taken.
    """
    moved = positions.copy()
    slides, turns = handles.fit(moved, state.base)
    for handle in body.handles:
        own = handle.vertices
        if handle.slide is not None:
            moved[own] = np.where(handle.slide, moved[own], state.base[own])
        elif not handle.loose:
            moved[own] = state.base[own]
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

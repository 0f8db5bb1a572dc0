# SPDX-License-Identifier: Apache-2.0
"""States at positions that a user sets, from which steps continue."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.errors import CommandError
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.elements.measures import least_volume_ratio
from gdfe_ros.solver.handle_motions import HandleMotions
from gdfe_ros.solver.state import State
from gdfe_ros.solver.terms.growth import Growths
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


def completed(state: State, own: State, growths: Growths, tolerance: float) -> State:
    """Return a state that was read from an archive, with the operators that follow from its commands.

    A state that converged only to a larger tolerance is marked as not converged.

    Args:
        state: the state from which a step will continue.
        own: the body's undeformed state.
        growths: the body's growths.
        tolerance: tolerance of an equilibrium, divided by the body's size.

    Raises:
        CommandError: the state belongs to another scene: vertices, handles, commands or terms differ.
    """
    for what, one, two in (
        ("vertices", len(state.positions), len(own.positions)),
        ("handles", sorted(state.poses), sorted(own.poses)),
        ("actuators and loads", sorted(state.commands), sorted(own.commands)),
        ("terms", sorted(state.terms), sorted(own.terms)),
    ):
        if one != two:
            raise CommandError(f"the state is one of another scene: its {what} are {one}, here {two}")
    near = state.summary.converged and state.summary.error_estimate <= tolerance
    return state.with_(
        operators=growths.at(state.commands, growths.ungrown),
        anchor=state.anchor and completed(state.anchor, own, growths, tolerance),
        summary=changed(state.summary, converged=near),
    )

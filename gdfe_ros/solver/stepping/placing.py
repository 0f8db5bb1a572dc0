# SPDX-License-Identifier: Apache-2.0
"""States at positions that a user sets, from which steps continue."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.constraints import Pose
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.errors import CommandError
from gdfe_ros.mesh.faces import vertex_pieces
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


def moved_along(
    body: Body, handles: HandleMotions, state: State, poses: Mapping[str, Pose]
) -> tuple[State, NDArray[np.float64]]:
    """Return a state with other commanded poses, and the positions (n, 3) [m] of the vertices that move along.

    Every connected piece of the body that a handle in ``poses`` holds moves with it as a rigid body.

    Args:
        body: the discretised body.
        handles: the kinematics of its handles.
        state: the state before.
        poses: dict from handle or obstacle to its new pose.

    Raises:
        CommandError: a handle that is not in ``poses`` holds one of these pieces, too.
    """
    positions, pieces = state.positions.copy(), vertex_pieces(body.cells, len(state.positions))
    holders = [handle for handle in body.handles if len(handle.vertices) and not isinstance(handle, RigidBody)]
    for handle in (each for each in holders if each.name in poses):
        along = np.isin(pieces, pieces[handle.vertices])
        others = [each.name for each in holders if each is not handle and along[each.vertices].any()]
        if others:
            text = f"{', '.join(others)} hold the same piece of the body as {handle.name!r}, which cannot move alone"
            raise CommandError(f"{text}; remedy: ~/reset or ~/reset_shape")
        centre, old = handle.centre(body.rest), state.poses[handle.name]
        back = Rotation.from_rotvec(old.rotation).inv().apply(positions[along] - centre - old.translation)
        positions[along] = poses[handle.name].apply(back + centre, centre)
    together = {**state.poses, **poses}
    return state.with_(poses=together, base=handles.base(together, state.poses, state.base)), positions


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

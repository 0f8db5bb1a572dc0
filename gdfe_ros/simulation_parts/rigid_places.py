# SPDX-License-Identifier: Apache-2.0
"""Teleports: of rigid bodies, of soft bodies that keep their shape, and of pieces that a handle holds."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.constraints import Pose
from gdfe_ros.constraints.overlap_depths import inside_surface, overlaps, place_now
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.errors import CommandError, OverlapError
from gdfe_ros.mesh.cells.faces import vertex_pieces
from gdfe_ros.mesh.cells.tetrahedra import flat_quads
from gdfe_ros.mesh.touching import outline
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.handle_motions import HandleMotions
from gdfe_ros.solver.motion import inertia, viscosity
from gdfe_ros.solver.motion.stepper import MotionStepper
from gdfe_ros.solver.state import Saved, State, replace_fields
from gdfe_ros.solver.vectors import Array

UNTOLD = "bodies were moved to other places, and no step has been made since"


def put_rigid(stepper: MotionStepper, state: State, places: Mapping[str, Pose]) -> State:
    """Return ``state`` with the rigid bodies of ``places`` at other poses and without velocity.

    The change of energy counts as work done on them. ``places`` is a dict from body name to pose, relative to the
    body's rest pose.

    Raises:
        OverlapError: a rigid body is inside of an obstacle, another rigid body, or the soft body there.
    """
    body, handles = stepper.body, stepper.equilibrium.handles
    vertices = np.concatenate([each.vertices for each in body.rigid_bodies if each.name in places])
    slides, turns = handles.put(state.slides, state.turns, places)
    positions = state.positions.copy()
    positions[vertices] = handles.apply_free_motion(state.base, slides, turns)[vertices]
    found = _stop(stepper, state.with_(slides=slides, turns=turns), vertices, positions)
    require_free(body, found, places)
    return stepper.carry_energies(release(stepper, found, vertices), state)


def carry_soft(stepper: MotionStepper, state: State, vertices: NDArray[np.int32], positions: Array) -> State:
    """Return ``state`` with ``vertices`` of soft bodies at their rows of ``positions`` (n, 3) [m], without velocity.

    The bodies have moved rigidly. The change of energy counts as work done on them.
    """
    found = _stop(stepper, state, vertices, positions)
    return stepper.carry_energies(release(stepper, found, vertices), state)


def _stop(stepper: MotionStepper, state: State, vertices: NDArray[np.int32], positions: Array) -> State:
    """Return ``state`` with ``vertices`` at their rows of ``positions`` (n, 3) [m] and without velocity.

    ``vertices`` are all vertices of some free bodies. These bodies have moved rigidly, so that their strains are as
    before.
    """
    terms, places = dict(state.terms), positions[vertices]
    for contact in stepper.actuation.contacts:
        if np.isin(contact.vertices, vertices).any():
            terms[contact.name] = {**contact.neutral(), "lost": terms[contact.name]["lost"]}
    if terms[inertia.NAME]["h"][0]:
        still = dict.fromkeys(("velocity", "velocity_before", "acceleration", "balanced", "pushed"), 0.0)
        terms[inertia.NAME] = _with_rows(terms[inertia.NAME], vertices, positions=places, before=places, **still)
    if viscosity.NAME in terms:
        saved, cells = terms[viscosity.NAME], np.isin(stepper.body.cells[:, 0], vertices)
        rows = np.repeat(cells, len(saved["strain"]) // len(cells))
        terms[viscosity.NAME] = _with_rows(saved, rows, before=saved["strain"][rows])
    ledger = replace_fields(state.ledger, failure=None)
    return state.with_flaw(UNTOLD).with_(positions=positions, terms=terms, motion=None, tangent=None, ledger=ledger)


def release(stepper: MotionStepper, state: State, vertices: NDArray[np.int32]) -> State:
    """Return ``state`` with the accelerations that the forces give to ``vertices``, which are at rest.

    The previous step in the returned state is that of a motion with these accelerations, so that the time scheme can
    continue.
    """
    saved = state.terms[inertia.NAME]
    h, places = float(saved["h"][0]), saved["positions"][vertices]
    if not h:
        return state
    still = state.with_(terms={**state.terms, inertia.NAME: stepper.at_rest().terms[inertia.NAME]})
    pull = stepper.free_mass.accelerate(-stepper.equilibrium.forces(still))[vertices]
    last = {"before": places + 0.5 * h * h * pull, "velocity_before": -h * pull}
    kept = _with_rows(saved, vertices, acceleration=pull, balanced=pull, **last)
    return state.with_(terms={**state.terms, inertia.NAME: kept})


def require_free(body: Body, state: State, names: Collection[str]) -> None:
    """Raise OverlapError if a rigid body in ``names`` is inside of an obstacle, another body, or the soft body."""
    placed = place_now(body.handles, state.poses, state.positions)
    surface = outline(flat_quads(body.cell_type.boundary(body.cells).quads), body.skin, state.positions)
    found = list(overlaps(placed, names))
    found += [inside_surface(one, *surface) for one in placed if one.thing.name in names]
    if any(found):
        raise OverlapError("; ".join(text for text in found if text))


def move_along(body: Body, handles: HandleMotions, state: State, poses: Mapping[str, Pose]) -> tuple[State, Array]:
    """Return a state with other commanded poses, and the positions (n, 3) [m] of all vertices after that.

    Every connected piece of the body that a handle in ``poses`` holds moves with the handle as a rigid body.

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


def _with_rows(saved: Saved, rows: NDArray[np.generic], **values: Array | float) -> Saved:
    """Return a term's stored state with ``values``, by name of the array, in the given ``rows`` of its arrays."""
    kept = dict(saved)
    for name, value in values.items():
        kept[name] = saved[name].copy()
        kept[name][rows] = value
    return kept

# SPDX-License-Identifier: Apache-2.0
"""Choice of the stepper of a scene: equilibria, or motion with dynamics; and the results of its steps."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints.rigid_body import rigid_among
from gdfe_ros.materials import cell_densities
from gdfe_ros.mesh import HexMesh
from gdfe_ros.paper.relative import RelativeEquilibrium
from gdfe_ros.results.step_result import StepResult
from gdfe_ros.scene.scene import Scene
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.contact.field import find_touches
from gdfe_ros.solver.forces.actuation import Actuation
from gdfe_ros.solver.motion.inertia import mass_matrix
from gdfe_ros.solver.motion.stepper import MotionStepper
from gdfe_ros.solver.outcome import Deadline
from gdfe_ros.solver.settings import Policy, Skip, SolverSettings, Torsion
from gdfe_ros.solver.solution import PathResult
from gdfe_ros.solver.state import State
from gdfe_ros.solver.stepping.stepper import Stepper
from gdfe_ros.solver.terms.fibres import FibreTerm
from gdfe_ros.solver.terms.term import Term

SHARPER = 0.1
"""Factor on the tolerance in a motion with yielding joints of arms, because errors of the body's wrench move the
joints.
"""
RELATIVE_STEPS = 20
"""Default load steps of a program under the ``relative`` policy."""
FAR_AWAY = 10.0
"""If a body is farther from the world's origin than this [body lengths], its centre becomes the solver's origin."""


def make_stepper(
    scene: Scene, settings: SolverSettings, body: Body, makers: Sequence[Callable[[Body], Term]] = ()
) -> Stepper | MotionStepper:
    """Return the stepper of a scene's body.

    Args:
        scene: scene with the actuators, loads and dynamics.
        settings: settings of the solver.
        body: discretised body.
        makers: functions that make further terms; each is called with the body.
    """

    def acting(more: Sequence[Term] = ()) -> Actuation:
        passive = [*(FibreTerm(layer, body) for layer in scene.fibres), *(make(body) for make in makers)]
        return Actuation(body, actuators, scene.loads, [*passive, *more])

    origin = scene.mesh.vertices[0] - body.rest[0]
    actuators = [each.seen_from(origin) for each in scene.actuators]

    if scene.dynamics is None:
        actuation = acting()
        paper = RelativeEquilibrium(body, actuation) if settings.policy is Policy.RELATIVE else None
        return Stepper(body, settings, actuation, paper)
    if any(arm.springs is not None for arm in scene.arms):
        settings = replace(settings, tolerance=SHARPER * settings.tolerance)
    density, filling = cell_densities(scene.materials, scene.cell_material), scene.mesh.filling
    mass = mass_matrix(body.rest, body.cells, density, scene.masses, filling=filling)
    return MotionStepper(body, settings, scene.dynamics, mass, acting)


def step_result(
    stepper: Stepper | MotionStepper,
    state: State,
    outcome: PathResult | None,
    *,
    time: float,
    origin: NDArray[np.float64],
    started: float,
    limit: Deadline | None,
) -> StepResult:
    """Return the result of a step.

    Args:
        stepper: the stepper that made the step.
        state: state after the step.
        outcome: outcome of the step; None if nothing had to be solved.
        time: simulation time [s] after the step.
        origin: (3,) [m] origin of the state's positions in the world.
        started: ``time.perf_counter`` at the beginning [s].
        limit: the deadline; None if there is none.
    """
    summary, velocities, own = state.summary, stepper.velocities(state), slice(stepper.body.count)
    return StepResult(
        time=time,
        positions=state.positions[own] + origin,
        converged=summary.converged,
        iterations=outcome.iterations if outcome else 0,
        error_estimate=summary.error_estimate,
        energy=summary.energy,
        min_det=summary.min_det,
        reactions={name: wrench.copy() for name, wrench in summary.reactions.items()},
        contacts=find_touches(stepper.actuation.contacts, state, origin),
        actuators=dict(summary.actuators),
        terms={name: dict(report) for name, report in summary.terms.items()},
        skipped=outcome.skipped if outcome else {Skip.SOLVE.value: 1},
        substeps=outcome.increments if outcome else 0,
        restarts=outcome.restarts if outcome else 0,
        wall_time=clock.perf_counter() - started,
        policy=stepper.settings.policy,
        message=summary.message,
        stable=summary.stable if summary.converged else None,
        estimated=summary.estimated,
        cut_after=limit.after if limit else None,
        velocities=None if velocities is None else velocities[own],
        energies=stepper.energies(state),
    )


def scene_body(scene: Scene, origin: NDArray[np.float64], torsion: Torsion = Torsion.CELL) -> Body:
    """Return the discretised body of a scene, with positions relative to ``origin`` (3,) [m].

    The vertices of the mesh come first, then those of rigid bodies.
    """
    handles = [handle.seen_from(origin) for handle in scene.handles]
    rigid = [body.places for body in rigid_among(handles)]
    rest = np.concatenate([scene.mesh.vertices - origin, *rigid])
    mesh, touching = scene.mesh, scene.self_contact
    return Body.build(
        rest,
        mesh.cells,
        tuple(scene.materials.values()),
        scene.cell_material,
        handles,
        mesh.filling,
        touching and touching.seen_from(origin),
        torsion=torsion,
        size=mesh.size,
        skin=mesh.touching,
    )


def working_origin(mesh: HexMesh) -> NDArray[np.float64]:
    """Return the solver's origin (3,) [m]: the world's origin, or the centre of a body that is far from it.

    Rounding grows with the distance: 1000 m from the origin, a body of 0.4 m is solved to 1e-7 of its size at best.
    """
    centre = mesh.bounds.mean(axis=0)
    return centre if np.linalg.norm(centre) > FAR_AWAY * mesh.size else np.zeros(3)


def usual_steps(scene: Scene, policy: Policy) -> int | None:
    """Return the default number of load steps of a scene's program; None means one load step for each keyframe."""
    if scene.dynamics is not None:
        return math.ceil(scene.program.duration / scene.dynamics.step)
    return RELATIVE_STEPS if policy is Policy.RELATIVE else None

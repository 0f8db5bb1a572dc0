# SPDX-License-Identifier: Apache-2.0
"""Assembly of the result that a user receives from a step."""

from __future__ import annotations

import time as clock

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.solver.deadline import Deadline
from gdfe_ros.solver.motion.stepper import MotionStepper
from gdfe_ros.solver.result import StepResult
from gdfe_ros.solver.settings import Skip, SolverSettings
from gdfe_ros.solver.state import State
from gdfe_ros.solver.stepping.march import March
from gdfe_ros.solver.stepping.stepper import Stepper


def step_result(
    stepper: Stepper | MotionStepper,
    state: State,
    march: March | None,
    *,
    time: float,
    origin: NDArray[np.float64],
    settings: SolverSettings,
    started: float,
    limit: Deadline | None,
) -> StepResult:
    """Return the result of a step.

    Args:
        stepper: the stepper that made the step.
        state: state after the step.
        march: outcome of the step; None if nothing had to be solved.
        time: simulation time [s] after the step.
        origin: (3,) [m] origin of the state's positions in the world.
        settings: settings of the solver.
        started: ``time.perf_counter`` at the beginning [s].
        limit: the deadline; None if there is none.
    """
    summary, velocities, own = state.summary, stepper.velocities(state), slice(stepper.body.count)
    return StepResult(
        time=time,
        positions=state.positions[own] + origin,
        converged=summary.converged,
        iterations=march.iterations if march else 0,
        error_estimate=summary.error_estimate,
        energy=summary.energy,
        min_det=summary.min_det,
        reactions={name: wrench.copy() for name, wrench in summary.reactions.items()},
        contacts={contact.name: contact.touch(state, origin) for contact in stepper.actuation.contacts},
        actuators=dict(summary.actuators),
        terms={name: dict(report) for name, report in summary.terms.items()},
        skipped=march.skipped if march else {Skip.SOLVE.value: 1},
        substeps=march.increments if march else 0,
        restarts=march.restarts if march else 0,
        wall_time=clock.perf_counter() - started,
        policy=settings.policy,
        factorisation=stepper.equilibrium.matrix.kind.value,
        message=summary.message,
        stable=summary.stable if summary.converged else None,
        estimated=summary.estimated,
        cut_after=limit.after if limit else None,
        velocities=None if velocities is None else velocities[own],
        energies=stepper.energies(state),
    )

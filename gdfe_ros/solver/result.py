# SPDX-License-Identifier: Apache-2.0
"""What one step of a simulation returns."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators.actuator import ActuatorState
from gdfe_ros.solver.contact.touch import Touch
from gdfe_ros.solver.settings import Policy


@dataclass(frozen=True, eq=False)
class StepResult:
    """State, quality and cost of one step.

    Attributes:
        time: simulation time [s].
        positions: (n, 3) float64 [m], a copy of your own.
        converged: the residual is at most the tolerance, every handle is where it was commanded, and no element is
            folded or inverted.
        iterations: linear solves with the constant matrix.
        residual: estimated largest distance to the equilibrium over the body's size: the preconditioned step, divided
            by the factor by which it may fall short. Infinite where a solve was cut: the distance is not known then.
        energy: strain energy [J].
        min_det: least volume ratio at a corner of an element, of a cut cell of the box that it is, det F there; not
            positive where one is folded or inverted.
        reactions: by handle and obstacle (6,) float64: the force [N] and the moment [N m] about the handle's deformed
            centre, or the obstacle's origin, that it exerts on the body.
        contacts: by obstacle, the vertices that touch it and the forces there; under ``(self)`` those that touch the
            body itself.
        skipped: work that was not needed, by name.
        substeps: increments that the step was cut into.
        wall_time: time spent [s].
        policy: which policy solved.
        factorisation: what solves with the constant matrix.
        message: what is wrong; empty where nothing is.
        stable: the energy curves up in every direction, as looked at where a motion begins or is not smooth; False: the
            body stands at a saddle, which it leaves when it is pushed; None: nobody looked, or it did not converge.
        cut_after: how often the solve asked for the time before its deadline had passed; None: it never passed.
        actuators: by name, command, length or volume, tension or pressure of each actuator.
        terms: reports of terms that were added to the simulation, by their names.
        restarts: 1 where the step ended in folded or inverted elements or, from given positions, in another
            equilibrium, and was made again from rest, or where obstacles let go of the body; the message says why.
        velocities: (n, 3) [m/s] with dynamics, a copy of your own; None without.
        energies: with dynamics: kinetic, elastic, potential, work done and dissipated since the start [J], by name.
    """

    time: float
    positions: NDArray[np.float64]
    converged: bool
    iterations: int
    residual: float
    energy: float
    min_det: float
    reactions: dict[str, NDArray[np.float64]]
    skipped: dict[str, int]
    substeps: int
    wall_time: float
    policy: Policy
    factorisation: str
    message: str = ""
    stable: bool | None = None
    cut_after: int | None = None
    contacts: dict[str, Touch] = field(default_factory=dict)
    actuators: dict[str, ActuatorState] = field(default_factory=dict)
    terms: dict[str, dict[str, float]] = field(default_factory=dict)
    restarts: int = 0
    velocities: NDArray[np.float64] | None = None
    energies: dict[str, float] = field(default_factory=dict)

# SPDX-License-Identifier: Apache-2.0
"""The result of one step of a simulation."""

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
        positions: (n, 3) float64 [m], a copy.
        converged: the error estimate is at most the tolerance, every handle is where it was commanded, and no element
            is folded or inverted.
        iterations: linear solves with the constant matrix.
        error_estimate: estimated largest distance to the equilibrium over the body's size: the preconditioned step over
            its least ratio to that distance. Infinite if it is unknown, e.g. for a solve that was cut.
        energy: strain energy [J].
        min_det: least volume ratio det F at a corner of an element; for a cut cell, of the whole box. Not positive if
            an element is folded or inverted.
        reactions: by handle and obstacle, the wrench (6,) float64 on the body: force [N], and moment [N m] about the
            handle's deformed centre or the obstacle's origin.
        contacts: by obstacle, the vertices that touch it and their forces; under ``(self)`` those that touch the body
            itself.
        skipped: counts of work that was left out, by name.
        substeps: increments into which the step was divided.
        wall_time: elapsed time [s].
        policy: the policy of the solve.
        factorisation: the library that solves with the constant matrix.
        message: the defect; empty if there is none.
        stable: whether the energy curves up in every direction; this is checked where a motion begins or is not smooth.
            False: the body is at a saddle, which it leaves when pushed. None: not checked, or not converged.
        cut_after: number of time checks before the deadline of the solve passed; None if it did not pass.
        actuators: by name, command, length or volume, tension or pressure of each actuator.
        terms: reports of the terms that were added to the simulation, by name.
        restarts: 1 if the step was repeated from rest, or if contact with obstacles was dropped; otherwise 0. A step is
            repeated if it ended in folded or inverted elements, or from given positions in another equilibrium. The
            message has the reason.
        velocities: (n, 3) [m/s] with dynamics, a copy; None without.
        energies: with dynamics, by name: kinetic, elastic, potential, work done and dissipated energy since the
            start [J].
    """

    time: float
    positions: NDArray[np.float64]
    converged: bool
    iterations: int
    error_estimate: float
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

# SPDX-License-Identifier: Apache-2.0
"""The result of one step of a simulation."""

from __future__ import annotations

from collections.abc import Mapping
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
        converged: whether the error estimate is at most the tolerance, every handle is at its commanded pose, and no
            element is folded or inverted.
        iterations: number of iterations; each evaluates the body and solves a linear system once.
        error_estimate: estimated largest distance of a vertex to the equilibrium, divided by the body's size. Infinite
            if it is unknown, for example if the deadline ended the solve.
        estimated: whether ``error_estimate`` is only an estimate, because the body's tangent is too expensive to be
            factored, and the constant matrix takes its place.
        energy: strain energy [J].
        min_det: least elastic volume ratio det F at a corner of an element, with growth det(F G^-1); for a cut cell, of
            the whole box. Not positive if an element is folded or inverted.
        reactions: dict from handle or obstacle name to the wrench (6,) float64 on the body: force [N], then moment
            [N m] about the handle's deformed centre or the obstacle's origin.
        contacts: mapping from obstacle name to the vertices that touch the obstacle and their contact forces, which are
            found when they are first read. The key ``(self)`` has the contacts of the body with itself.
        skipped: dict from kind of work (`Skip`) to the number of solves, updates or elements that were left out.
        substeps: number of increments or internal steps that were attempted.
        wall_time: elapsed time [s].
        policy: the policy of the solve.
        message: description of the defect; empty if there is none.
        stable: whether the energy has positive curvature in every direction, according to the last proof or search. A
            proof follows the first step, costly solves, solves that move a vertex far, and a doubling of the strain
            energy since the last proof. False: the body is at a saddle of the energy and leaves it when pushed. None:
            not known, or not converged.
        cut_after: number of time checks before the deadline of the solve passed; None if it did not pass.
        actuators: dict from actuator name to its command, extent and effort.
        terms: dict from the name of a term that was added to the simulation to its report.
        restarts: 1 if the result was reached from the undeformed body, or after contact with obstacles was dropped,
            instead of along the load path; otherwise 0. Both are tried only after a load path fails or begins with
            folded or inverted elements. The message has the reason.
        velocities: (n, 3) [m/s] with dynamics, a copy; None without dynamics.
        energies: dict from name to energy [J] with dynamics: kinetic, elastic, potential, work done and dissipated
            energy since the start. Empty without dynamics.
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
    message: str = ""
    stable: bool | None = None
    estimated: bool = False
    cut_after: int | None = None
    contacts: Mapping[str, Touch] = field(default_factory=dict)
    actuators: dict[str, ActuatorState] = field(default_factory=dict)
    terms: dict[str, dict[str, float]] = field(default_factory=dict)
    restarts: int = 0
    velocities: NDArray[np.float64] | None = None
    energies: dict[str, float] = field(default_factory=dict)

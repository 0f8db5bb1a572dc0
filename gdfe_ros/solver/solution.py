# SPDX-License-Identifier: Apache-2.0
"""What a solve is asked and what it answers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints import Pose
from gdfe_ros.solver.deadline import Deadline
from gdfe_ros.solver.descent.active_set import Movable
from gdfe_ros.solver.state import Balance, State


@dataclass(frozen=True, eq=False, kw_only=True)
class Increment:
    """What a solve is to find an equilibrium for.

    Attributes:
        poses: of every handle, relative to its rest pose.
        commands: of every actuator and load.
        tolerance: estimated largest distance to the equilibrium over the body's size.
        limit: most iterations.
        deadline: when it has passed, the best positions so far are returned; None: never.
        keeping: to which commanded lengths and hourglass scales are kept, likewise; None: the tolerance.
        volumes: to which pressures keep volumes, likewise; None: as ``keeping``.
    """

    poses: Mapping[str, Pose]
    commands: Mapping[str, float]
    tolerance: float
    limit: int
    deadline: Deadline | None = None
    keeping: float | None = None
    volumes: float | None = None

    @classmethod
    def at(cls, state: State, *, tolerance: float, limit: int, deadline: Deadline | None = None) -> Increment:
        """Ask for the equilibrium at the commands that are in force in a state."""
        return cls(poses=state.poses, commands=state.commands, tolerance=tolerance, limit=limit, deadline=deadline)


@dataclass(frozen=True, eq=False, kw_only=True)
class Solution:
    """The best that a solve found; `accept` of the equilibrium that found it makes it a state.

    Attributes:
        state: everything but what acceptance adds: histories, and what is held.
        iterations: linear solves with the constant matrix.
        cut: the limit or the deadline ended it.
        diverged: the energy has no lower bound.
        exhausted: it is as near as double precision allows: a shorter way would not lead nearer.
        buried: surfaces are deep in each other, not only beyond the bound.
        lost: how far the equilibrium is could not be known: a shorter way may lead nearer, but not a much shorter one.
        began: (n, 3) where the solve began [m].
        balance: of an equilibrium; None where it is none, or has no energy.
        tolerance: that was asked for.
        active: what was moved.
        run: which of its solves this was, for `accept`.
    """

    state: State
    iterations: int
    cut: bool = False
    diverged: bool = False
    exhausted: bool = False
    lost: bool = False
    buried: bool = False
    began: NDArray[np.float64]
    balance: Balance | None = None
    tolerance: float
    active: Movable
    run: int = 0

    @property
    def converged(self) -> bool:
        """Whether it is an equilibrium, to the tolerance."""
        return self.state.summary.converged

    @property
    def positions(self) -> NDArray[np.float64]:
        """Positions (n, 3) [m]."""
        return self.state.positions

    @property
    def residual(self) -> float:
        """Estimated largest distance to the equilibrium over the body's size; infinite where it is not known."""
        return self.state.summary.residual

    @property
    def message(self) -> str:
        """Why it did not converge; empty if it did."""
        return self.state.summary.message

    @property
    def min_det(self) -> float:
        """Least volume ratio at a corner of an element."""
        return self.state.summary.min_det

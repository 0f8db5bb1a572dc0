# SPDX-License-Identifier: Apache-2.0
"""Request and result of a solve, and what every result has."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints import Pose
from gdfe_ros.solver.deadline import Deadline
from gdfe_ros.solver.outcome import Outcome
from gdfe_ros.solver.state import State


@dataclass(frozen=True, eq=False, kw_only=True)
class Increment:
    """Request of a solve: the commands for which it finds an equilibrium, its tolerances and its limits.

    Attributes:
        poses: pose of every handle, relative to its rest pose.
        commands: command of every actuator and load.
        tolerance: allowed distance to the equilibrium, divided by the body's size.
        limit: largest number of iterations.
        deadline: once it has passed, the solve returns its best positions so far; None for no deadline.
        begins: fraction of the load path at which the increment begins.
        divisible: whether a shorter increment may follow, so that a solve is given up once a chamber inflates.
        keeping: relative tolerance of commanded lengths and of hourglass scales; None stands for ``tolerance``.
        volumes: relative tolerance of the volumes of elements with a pressure; None stands for ``keeping``.
    """

    poses: Mapping[str, Pose]
    commands: Mapping[str, float]
    tolerance: float
    limit: int
    deadline: Deadline | None = None
    begins: float = 0.0
    divisible: bool = False
    keeping: float | None = None
    volumes: float | None = None

    @classmethod
    def at(cls, state: State, *, tolerance: float, limit: int, deadline: Deadline | None = None) -> Increment:
        """Return the request for the equilibrium at the poses and commands of ``state``."""
        return cls(poses=state.poses, commands=state.commands, tolerance=tolerance, limit=limit, deadline=deadline)


@dataclass(frozen=True, eq=False, kw_only=True)
class Found:
    """A state that a solve or a step has found.

    Attributes:
        state: the state.
        iterations: number of iterations.
    """

    state: State
    iterations: int = 0

    @property
    def converged(self) -> bool:
        """Whether the positions are an equilibrium to the tolerance."""
        return self.state.summary.converged

    @property
    def positions(self) -> NDArray[np.float64]:
        """Positions (n, 3) [m]."""
        return self.state.positions

    @property
    def error_estimate(self) -> float:
        """Estimated largest distance to the equilibrium, divided by the body's size; infinite if it is unknown."""
        return self.state.summary.error_estimate

    @property
    def message(self) -> str:
        """Description of the defect; empty if there is none."""
        return self.state.summary.message

    @property
    def min_det(self) -> float:
        """Least volume ratio det F at a corner of an element."""
        return self.state.summary.min_det


@dataclass(frozen=True, eq=False, kw_only=True)
class Solution(Found):
    """Result of a solve; the equilibrium solver's `accept` completes its state.

    Attributes:
        state: the final state, still without the motion that `accept` adds.
        ended: how its last minimisation ended; `Outcome.NEAR` if it converged.
        entered: whether surfaces of the body penetrate each other.
        began: (n, 3) positions at the beginning of the solve [m].
    """

    ended: Outcome
    entered: bool = False
    began: NDArray[np.float64]

    @property
    def cut(self) -> bool:
        """Whether the limit or the deadline ended the solve."""
        return self.ended is Outcome.CUT

    @property
    def diverged(self) -> bool:
        """Whether the energy has no lower bound."""
        return self.ended is Outcome.RUNAWAY

    @property
    def exhausted(self) -> bool:
        """Whether no further descent was possible, because of the energy's rounding or at a kink of the energy."""
        return self.ended in (Outcome.EXHAUSTED, Outcome.NEUTRAL)

# SPDX-License-Identifier: Apache-2.0
"""What an equilibrium solve found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Outcome:
    """The best positions that a solve found and how good they are.

    Attributes:
        positions: (n, 3) float64 [m].
        converged: the residual is at most the tolerance.
        iterations: linear solves with the constant matrix.
        residual: estimated largest distance to the equilibrium over the body's size: the preconditioned step, divided
            by the factor by which it may fall short.
        message: why it did not converge; empty if it did.
        diverged: the energy has no lower bound; the positions are those that the solve began with.
        exhausted: it is as near as double precision allows: a shorter way would not lead nearer.
    """

    positions: NDArray[np.float64]
    converged: bool
    iterations: int
    residual: float
    message: str = ""
    exhausted: bool = False
    diverged: bool = False


@dataclass(frozen=True)
class State:
    """What the elements hold at the positions of the last solve.

    Attributes:
        energy: strain energy [J], with the full volume energy U(J).
        min_det: least determinant of the mean deformation gradient.
        force: corner forces dE/dx (m, 8, 3) [N]; overwritten by the next solve.
        outside: dE/dx (n, 3) [N] of actuators and loads; None where there are none.
        reactions: by handle (6,) float64, as in `StepResult`.
    """

    energy: float
    min_det: float
    force: NDArray[np.float64]
    outside: NDArray[np.float64] | None = None
    reactions: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)

# SPDX-License-Identifier: Apache-2.0
"""Energy account of a moving body, and the record of a failed step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from gdfe_ros.constraints import Pose


@dataclass(frozen=True, eq=False, kw_only=True)
class Failure:
    """A time step that fails from the present state, even with the shortest first internal step.

    Attributes:
        poses, commands: targets of the step.
        duration: of the step [s].
        length: of its internal steps [s] before any of them is halved.
        reason: why it fails.
    """

    poses: Mapping[str, Pose]
    commands: Mapping[str, float]
    duration: float
    length: float
    reason: str


@dataclass(frozen=True, eq=False, kw_only=True)
class Bound:
    """Extremes of a moving body's energy; they show whether a step creates energy.

    Attributes:
        start, least: kinetic + elastic + potential energy - work [J] at the beginning, and the minimum so far. Both are
            raised by the uncertainty of the later work.
        most: largest kinetic + elastic energy so far [J].
    """

    start: float
    least: float
    most: float


@dataclass(frozen=True, eq=False, kw_only=True)
class Ledger:
    """Work and dissipated energy of a moving body since the start, and time that has passed without a step.

    Attributes:
        work: done on the body by handles and by changing commands [J].
        lost: energy dissipated by damping and friction [J].
        owed: time [s] that has passed without a step because it was too short for one.
        failure: the last step if it failed; None if it succeeded.
        bound: extremes of the energy; None before a step that restarts the account.
    """

    work: float
    lost: float
    owed: float = 0.0
    failure: Failure | None = None
    bound: Bound | None = None

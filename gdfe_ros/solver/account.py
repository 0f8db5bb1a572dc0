# SPDX-License-Identifier: Apache-2.0
"""Energy account of a moving body, and the record of a failed step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from gdfe_ros.constraints import Pose


@dataclass(frozen=True, eq=False, kw_only=True)
class Failure:
    """Record of a time step whose first internal step fails from the present state, even at the shortest length.

    Attributes:
        poses, commands: targets of the step.
        duration: duration of the step [s].
        length: length of its internal steps [s] before any of them is halved.
        reason: reason for the failure.
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
        start: kinetic + elastic + potential energy - work [J] at the beginning.
        least: minimum of kinetic + elastic + potential energy - work so far [J]. The uncertainty of later work is added
            to ``start`` and ``least``.
        most: largest kinetic + elastic energy so far [J].
    """

    start: float
    least: float
    most: float


@dataclass(frozen=True, eq=False, kw_only=True)
class Ledger:
    """Work and dissipated energy of a moving body since the start, and time that is not simulated yet.

    Attributes:
        work: work of handles and of changing commands on the body [J].
        lost: energy dissipated by damping and friction [J].
        owed: reported time [s] that was too short to simulate; the next step includes it.
        failure: the last step if it failed; None if it succeeded.
        bound: extremes of the energy; None if the next step starts them anew.
    """

    work: float
    lost: float
    owed: float = 0.0
    failure: Failure | None = None
    bound: Bound | None = None

# SPDX-License-Identifier: Apache-2.0
"""What the state of a moving body remembers of its energy, and of a step that led nowhere."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from gdfe_ros.constraints import Pose


@dataclass(frozen=True, eq=False, kw_only=True)
class Failure:
    """A step in time that fails from where a body is, however short its first internal step is made.

    Attributes:
        poses, commands: that it was to reach.
        duration: of the step [s].
        length: of its internal steps, before one is cut [s].
        reason: why it fails.
    """

    poses: Mapping[str, Pose]
    commands: Mapping[str, float]
    duration: float
    length: float
    reason: str


@dataclass(frozen=True, eq=False, kw_only=True)
class Bound:
    """What the energy of a moving body has been, for telling whether a step makes any.

    Attributes:
        start, least: kinetic + elastic + potential energy - work [J] at the beginning and at the least, each with what
            the work since may have been more than it is booked as.
        most: largest kinetic + elastic energy so far [J].
    """

    start: float
    least: float
    most: float


@dataclass(frozen=True, eq=False, kw_only=True)
class Ledger:
    """What a moving body was given and lost since the start, and what it owes.

    Attributes:
        work: done on it by handles and by changing commands [J].
        lost: to damping [J].
        owed: time [s] that has passed without a step, too short for one.
        failure: the step that was tried last, where it led nowhere; None where it did not.
        bound: of its energy; None where the account begins anew with the next step.
    """

    work: float
    lost: float
    owed: float = 0.0
    failure: Failure | None = None
    bound: Bound | None = None

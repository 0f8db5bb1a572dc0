# SPDX-License-Identifier: Apache-2.0
"""The energy balance of an increment: did the body give up energy that neither plates nor commands took?

Along a stable branch the potential changes by the work of plates and commands, the integral of its slopes. Where the
slopes are monotone that integral lies between those of its two ends, for loads always: the potential of a stable
branch is concave in a load. Energy that is lost beyond these bounds was lost in a jump to another branch.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints import Pose
from gdfe_ros.solver.actuation import Actuation
from gdfe_ros.solver.outcome import Outcome, State

LOST = 0.5
"""Energy lost in an increment, over the largest of energies and work, that is a jump however long the increment."""
PROVEN = 0.01
"""The same beyond the bounds of the work."""
LEAST_MOTION = 5e-3
"""Of the body's size: farther than that from where the motion pointed, or it is no jump. A cable that becomes taut
inside an increment upsets the balance, too, but moves nothing far."""


@dataclass(frozen=True)
class Balance:
    """What the potential of an equilibrium is and how fast commands change it.

    Attributes:
        energy: strain energy [J].
        potential: of all that acts from outside [J]; zero at rest and where a length or a volume is commanded.
        slopes: d(energy + potential)/d(command) at the equilibrium, by actuator and load.
        reactions: wrench (6,) [N], [N m] of every plate on the body.
        poses: of the plates.
        commands: of actuators and loads.
    """

    energy: float
    potential: float
    slopes: Mapping[str, float]
    reactions: Mapping[str, NDArray[np.float64]]
    poses: Mapping[str, Pose]
    commands: Mapping[str, float]

    def work_to(self, other: Balance) -> tuple[float, float]:
        """Return the work [J] that plates and commands put in on the way to another equilibrium, and its doubt.

        The trapezoidal rule; the doubt is half of what lies between the work with the first and the last slopes.
        """
        work, doubt = 0.0, 0.0
        for name, pose in other.poses.items():
            if pose == self.poses[name]:
                continue
            way = _way(self.poses[name], pose)
            work += 0.5 * float((self.reactions[name] + other.reactions[name]) @ way)
            doubt += 0.5 * abs(float((other.reactions[name] - self.reactions[name]) @ way))
        for name, slope in other.slopes.items():
            change = other.commands[name] - self.commands[name]
            work += 0.5 * (self.slopes[name] + slope) * change
            doubt += 0.5 * abs((slope - self.slopes[name]) * change)
        return work, doubt

    def jumps_to(self, other: Balance) -> bool:
        """Tell whether energy is lost on the way to another equilibrium, as where a body buckles or snaps through."""
        work, doubt = self.work_to(other)
        lost = self.energy + self.potential + work - other.energy - other.potential
        scale = max(self.energy, other.energy, abs(work), abs(other.potential - self.potential))
        return lost > LOST * scale or lost > doubt + PROVEN * scale


def weigh(
    outcome: Outcome, state: State, actuation: Actuation, poses: Mapping[str, Pose], commands: Mapping[str, float]
) -> Balance | None:
    """Take the balance of what a solve found; None where it is no equilibrium, or shapes that grow have no energy."""
    if actuation.grown is not None or not outcome.converged:
        return None
    potential, slopes = actuation.potential(outcome.positions)
    return Balance(float(state.energy), potential, slopes, state.reactions, dict(poses), dict(commands))


def _way(begin: Pose, end: Pose) -> NDArray[np.float64]:
    """Return the motion (6,) that a wrench does its work on: shift, and turn in world axes halfway."""
    shift = np.subtract(end.translation, begin.translation)
    change, half = np.subtract(end.rotation, begin.rotation), 0.5 * np.add(end.rotation, begin.rotation)
    angle = float(np.linalg.norm(half))
    if angle > 0.0:
        axis, share = half / angle, np.sin(angle) / angle
        turn = share * change + (1.0 - share) * (axis @ change) * axis
        change = turn + (1.0 - np.cos(angle)) / angle * np.cross(axis, change)
    return np.concatenate([shift, change])

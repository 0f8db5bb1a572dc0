# SPDX-License-Identifier: Apache-2.0
"""Energy balance of an increment; it detects jumps to another equilibrium.

Along a stable branch, the potential changes by the work of handles and commands, the integral of its slopes with
respect to poses and commands. If the slopes are monotone, the integral lies between two bounds: those computed with the
first slopes and with the last slopes. Loads always have monotone slopes, because the potential of a stable branch is
concave in a load. If more energy is released than these bounds allow, the body has jumped to another branch.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints import Pose
from gdfe_ros.solver.handle_motions import HandleMotions
from gdfe_ros.solver.solution import Solution
from gdfe_ros.solver.state import State
from gdfe_ros.solver.vectors import largest_distance

PROVEN = 0.01
"""The energy balance shows a jump if the released energy minus the uncertainty of the work, divided by the largest of
the energies and the work, exceeds this.
"""
LEAST_MOTION = 5e-3
"""Least distance between the predicted and the actual end of a jump, divided by the body's size. A cable that becomes
taut during an increment also violates the balance, but causes no large displacement.
"""


def work_between(old: State, new: Solution, handles: HandleMotions) -> tuple[float, float]:
    """Return the work [J] of handles and commands between two equilibria, and its uncertainty [J].

    The work follows from the trapezoidal rule. The uncertainty is half of the difference between the work with the
    first slopes and the work with the last slopes.
    """
    work, doubt, found = 0.0, 0.0, new.state
    for name, pose in found.poses.items():
        if pose == old.poses[name]:
            continue
        begin, end = (handles.pose(name, state.poses, state.turns) for state in (old, found))
        moved, first, last = _displacement(begin, end), old.summary.reactions[name], found.summary.reactions[name]
        work += 0.5 * float((first + last) @ moved)
        doubt += 0.5 * abs(float((last - first) @ moved))
    for name, slope in new.balance.slopes.items():
        change, first = found.commands[name] - old.commands[name], old.balance.slopes[name]
        work += 0.5 * (first + slope) * change
        doubt += 0.5 * abs((slope - first) * change)
    return work, doubt


def jumped(old: State, new: Solution, handles: HandleMotions, size: float) -> bool:
    """Return whether a body of ``size`` [m] jumped between two equilibria, as in buckling.

    A jump releases energy and ends far from the positions that were predicted from the last motion.
    """
    if old.balance is None or new.balance is None:
        return False
    work, doubt = work_between(old, new, handles)
    before, after = old.summary.energy, new.state.summary.energy
    rubbed = new.state.dissipated - old.dissipated
    lost = before + old.balance.potential + work - after - new.balance.potential - rubbed
    scale = max(before, after, abs(work), abs(new.balance.potential - old.balance.potential))
    if not lost > doubt + PROVEN * scale:
        return False
    return bool(largest_distance(new.positions, new.began) > LEAST_MOTION * size)


def _displacement(begin: Pose, end: Pose) -> NDArray[np.float64]:
    """Return translation [m] and rotation about world axes [rad] (6,); their product with a wrench is its work."""
    shift = np.subtract(end.translation, begin.translation)
    if not (any(begin.rotation) or any(end.rotation)):
        return np.concatenate([shift, np.zeros(3)])
    change, half = np.subtract(end.rotation, begin.rotation), 0.5 * np.add(end.rotation, begin.rotation)
    (x, y, z), angle = half, math.sqrt(half @ half)
    if angle > 0.0:  # the left Jacobian of the exponential map, see `gdfe_ros.solver.matrix.rotation`
        cross, share = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]), math.sin(angle) / angle
        turn = share * change + (1.0 - share) * (half @ change / angle**2) * half
        change = turn + (1.0 - math.cos(angle)) / angle**2 * (cross @ change)
    return np.concatenate([shift, change])

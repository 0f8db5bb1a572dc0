# SPDX-License-Identifier: Apache-2.0
"""The energy balance of an increment: did the body give up energy that neither handles nor commands took?

Along a stable branch the potential changes by the work of handles and commands, the integral of its slopes. Where the
slopes are monotone that integral lies between those of its two ends, for loads always: the potential of a stable
branch is concave in a load. Energy that is lost beyond these bounds was lost in a jump to another branch.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.constraints import Pose
from gdfe_ros.solver.distance import largest_distance
from gdfe_ros.solver.handle_motions import HandleMotions
from gdfe_ros.solver.solution import Solution
from gdfe_ros.solver.state import State

LOST = 0.5
"""Energy lost in an increment, over the largest of energies and work, that is a jump however long the increment."""
PROVEN = 0.01
"""The same beyond the bounds of the work."""
LEAST_MOTION = 5e-3
"""Of the body's size: farther than that from where the motion pointed, or it is no jump. A cable that becomes taut
inside an increment upsets the balance, too, but moves nothing far."""


def work_between(old: State, new: Solution, handles: HandleMotions) -> tuple[float, float]:
    """Return the work [J] that handles and commands put in between two equilibria, and its doubt.

    The trapezoidal rule; the doubt is half of what lies between the work with the first and the last slopes.
    """
    work, doubt, found = 0.0, 0.0, new.state
    for name, pose in found.poses.items():
        if pose == old.poses[name]:
            continue
        begin, end = (handles.pose(name, state.poses, state.turns) for state in (old, found))
        way, first, last = _way(begin, end), old.summary.reactions[name], found.summary.reactions[name]
        work += 0.5 * float((first + last) @ way)
        doubt += 0.5 * abs(float((last - first) @ way))
    for name, slope in new.balance.slopes.items():
        change, first = found.commands[name] - old.commands[name], old.balance.slopes[name]
        work += 0.5 * (first + slope) * change
        doubt += 0.5 * abs((slope - first) * change)
    return work, doubt


def jumped(old: State, new: Solution, handles: HandleMotions, size: float) -> bool:
    """Tell whether the body, of a ``size`` [m], jumped on the way between two equilibria, as where it buckles.

    It did where energy is lost on the way and it ends far from where the motion pointed.
    """
    if old.balance is None or new.balance is None:
        return False
    work, doubt = work_between(old, new, handles)
    before, after = old.summary.energy, new.state.summary.energy
    rubbed = new.state.dissipated - old.dissipated
    lost = before + old.balance.potential + work - after - new.balance.potential - rubbed
    scale = max(before, after, abs(work), abs(new.balance.potential - old.balance.potential))
    if not (lost > LOST * scale or lost > doubt + PROVEN * scale):
        return False
    return bool(largest_distance(new.positions, new.began) > LEAST_MOTION * size)


def _way(begin: Pose, end: Pose) -> NDArray[np.float64]:
    """Return the motion (6,) that a wrench does its work on: shift, and turn in world axes halfway."""
    shift = np.subtract(end.translation, begin.translation)
    if not (any(begin.rotation) or any(end.rotation)):
        return np.concatenate([shift, np.zeros(3)])
    change, half = np.subtract(end.rotation, begin.rotation), 0.5 * np.add(end.rotation, begin.rotation)
    angle = float(np.linalg.norm(half))
    if angle > 0.0:
        axis, share = half / angle, np.sin(angle) / angle
        turn = share * change + (1.0 - share) * (axis @ change) * axis
        change = turn + (1.0 - np.cos(angle)) / angle * np.cross(axis, change)
    return np.concatenate([shift, change])

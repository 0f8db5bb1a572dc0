# SPDX-License-Identifier: Apache-2.0
"""Distance between a grip's holder and the vertices or body to be held, and a check that it is within reach."""

from __future__ import annotations

from collections.abc import Mapping

from scipy.spatial import cKDTree

from gdfe_ros.actuators.actuator import Grip
from gdfe_ros.constraints import Handle
from gdfe_ros.constraints.obstacle import Obstacle
from gdfe_ros.constraints.overlap_depths import Placed
from gdfe_ros.solver.forces.actuation import Actuation
from gdfe_ros.solver.state import State


def find_far_grips(actuation: Actuation, state: State, commands: Mapping[str, float]) -> dict[str, str]:
    """Return a dict from grip to message, for each grip that would close at ``commands`` beyond its reach."""
    found, handles = {}, {handle.name: handle for handle in actuation.body.handles}
    for grip in (each.actuator for each in actuation.grips):
        takes = commands[grip.name] > 0.0 and state.commands[grip.name] == 0.0
        if takes and (distance := measure_gap(grip, handles, state)) > grip.reach:
            held = f"body {grip.held!r}" if grip.held else "what it holds"
            found[grip.name] = (
                f"grip {grip.name!r} cannot take hold: {held} is {distance:.3g} m from {grip.holder!r}; allowed: "
                f"up to its `reach`, {grip.reach:g} m; remedy: bring them nearer first, or another reach"
            )
    return found


def measure_gap(grip: Grip, handles: Mapping[str, Handle], state: State) -> float:
    """Return the distance [m] between a grip's holder and the vertices or the rigid body that it would hold.

    Args:
        grip: the grip.
        handles: dict from name to handle, obstacle or rigid body.
        state: positions and poses.
    """
    holder, held, x = handles[grip.holder], handles.get(grip.held), state.positions
    if isinstance(holder, Obstacle):
        there = Placed.now(holder, state.poses, x)
        if held is None:
            return max(0.0, float(there.measure_points(x[grip.vertices])[0].min()))
        here, form = Placed.now(held, state.poses, x), held.form
        corners = there.measure_points(here.world(form.corners))[0].min() - form.rounding
        return max(0.0, min(float(corners), float(there.measure_points(here.world(form.skin))[0].min())))
    if held is None:
        return float(cKDTree(x[holder.vertices]).query(x[grip.vertices])[0].min())
    return max(0.0, float(Placed.now(held, state.poses, x).measure_points(x[holder.vertices])[0].min()))

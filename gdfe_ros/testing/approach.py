# SPDX-License-Identifier: Apache-2.0
"""The initial equilibrium of an environment, and steps towards wanted commands.

If a step does not converge, it is repeated with a smaller change of the commands.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators import Mode
from gdfe_ros.errors import GdfeError
from gdfe_ros.results.step_result import StepResult
from gdfe_ros.scene import Scene
from gdfe_ros.scene.building.builder import find_unheld
from gdfe_ros.simulation import Command, Simulation
from gdfe_ros.simulation_parts.grip_reach import find_far_grips


def settle(simulation: Simulation) -> None:
    """Bring a simulation from its initial state to the equilibrium of its initial commands; the time stays 0.

    With dynamics, the equilibrium is that of the scene without dynamics, and velocities are the initial ones. A scene
    with rigid bodies, or with a piece that no handle holds, has no equilibrium without dynamics, and stays in its
    initial state.

    Raises:
        GdfeError: the equilibrium was not found.
    """
    scene = simulation.scene
    if scene.dynamics is None:
        result = simulation.step(dt=0.0)
    elif is_held(scene):
        still = Simulation(replace(scene, dynamics=None))
        result = still.step(dt=0.0)
        simulation.set_positions(still.positions)
    else:
        return
    if not result.converged:
        text = f"scene {scene.name!r}: its equilibrium under the initial commands was not found: {result.message}"
        raise GdfeError(f"{text}; remedy: smaller loads, or `gdfe solve` to see what happens")


def is_held(scene: Scene) -> bool:
    """Return whether a scene has no rigid bodies, and handles hold each of its pieces.

    Such a scene has equilibria without dynamics.
    """
    holding = [handle for handle in scene.handles if handle.section == "handles"]
    return not scene.rigid_bodies and not any(find_unheld(scene.mesh, holding))


_SHARES = (1.0, 0.125, 0.0)
"""Fractions of the allowed change, tried in this order until a step converges. Near a loss of stability the whole
change often converges although smaller changes do not, because it passes the unstable range. More fractions would
mostly fail for the same reason.
"""
_BUDGET = 400
"""Largest number of iterations of a step without dynamics, before a smaller fraction is tried. Most need 20 to 150."""


class Approach:
    """Moves the commands of a simulation's actuators towards wanted commands, step by step.

    In a step each command changes by at most its ``reach``. If the step does not converge, it is repeated with an
    eighth of the change. If the repeated step does not converge either, the step is made with constant commands. A grip
    takes hold and lets go at once; it does not take hold of anything beyond its reach.

    Args:
        simulation: simulation to step.
        reach: (actuators,) largest change of each command in a step, in the unit of its mode; infinite for no limit.
    """

    def __init__(self, simulation: Simulation, reach: NDArray[np.float64]) -> None:
        self._simulation = simulation
        self._names = simulation.actuator_names
        ranges = [(actuator.low, actuator.high) for actuator in simulation.scene.actuators]
        self._low, self._high = np.array(ranges, dtype=np.float64).T
        grips = [actuator.mode is Mode.GRIP for actuator in simulation.scene.actuators]
        self._reach = np.where(grips, np.inf, reach)

    @property
    def applied(self) -> NDArray[np.float64]:
        """Commands of the last step, (actuators,), in the units of the modes."""
        return np.array([self._simulation.commands[name] for name in self._names], dtype=np.float64)

    def step(self, wanted: NDArray[np.float64], dt: float, *, whole: bool = False) -> StepResult:
        """Make one step towards wanted commands.

        Args:
            wanted: commands (actuators,) in the units of the modes; the applied commands stay within the actuators'
                ranges.
            dt: simulation time of the step [s].
            whole: whether to try only the whole allowed change.

        Returns:
            The result of the first trial that converged, or else of the last trial.
        """
        simulation, present = self._simulation, self.applied
        before = simulation.snapshot()
        asked = dict(zip(self._names, (np.asarray(wanted) >= 0.5).astype(float), strict=True))
        far = find_far_grips(simulation.stepper.actuation, simulation.state, asked)
        wanted = np.where([name in far for name in self._names], present, wanted)
        change = np.clip(wanted - present, -self._reach, self._reach)
        for share in _SHARES[: 1 if whole else None]:
            if share < 1.0:
                simulation.restore(before)
            values = np.clip(present + share * change, self._low, self._high).tolist()
            command = Command(actuators=dict(zip(self._names, values, strict=True)))
            # No limit of iterations for constant commands, nor for a scene with dynamics.
            budget = _BUDGET if share and not simulation.scene.dynamics else None
            result = simulation.step(command, dt=dt, cut_after=budget)
            if result.converged:
                break
        return result

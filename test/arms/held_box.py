# SPDX-License-Identifier: Apache-2.0
"""Play the scene `arm_grasp`, and measure the drift of the held box, efforts of the joints, and the energy balance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.arms.arm import Arm
from gdfe_ros.results.step_result import StepResult
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation

Vector = NDArray[np.float64]
QUIET = (9.0, 12.0)
"""Start and end [s] of the interval in which the drift is measured: while the box is held, after all vibrations."""
GRAVITY = np.array([0.0, 0.0, -9.81])


def measure(overrides: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Play the program of the scene and return what was measured.

    Returns:
        ``converged``, of all steps; ``drift`` of the held box [m/s]; ``effort error``: result of `effort_error` at the
        end of the hold; ``balance``: error of the energy balance, divided by the work of the motors.
    """
    simulation = Simulation(load_scene("arm_grasp", overrides=overrides))
    account, converged, (first, last) = Account(simulation), True, QUIET
    for result in simulation.play(round(simulation.scene.program.duration / simulation.scene.dynamics.step)):
        converged &= result.converged
        account.add(result)
        if abs(result.time - first) < 1e-6:
            begin = np.array(simulation.handle_pose("part").translation)
        elif abs(result.time - last) < 1e-6:
            drift = float(np.linalg.norm(simulation.handle_pose("part").translation - begin)) / (last - first)
            error = effort_error(simulation, result)
    return {"converged": converged, "drift": drift, "effort error": error, "balance": account.error}


def effort_error(simulation: Simulation, result: StepResult) -> float:
    """Return the largest error of the efforts compared with those of point weights, divided by the largest effort.

    The arm must not move. The point weights are those of each link, the hand and the box, at their centres of mass. A
    weight m g at p needs the effort -m g . dp/dq, where dp/dq is a central difference of the positions of the links.
    This check uses neither the Newton-Euler algorithm nor the wrench of the hand.
    """
    arm = simulation.scene.arms[0]
    states = simulation.joint_states()
    q = np.array([states[joint.name].position for joint in arm.joints])
    carried, mass = _carried_mass(simulation, result)
    flange = arm.dynamics.frames(q)[arm.flange]
    local = flange.axes.T @ (carried - flange.origin)

    def lift(at: Vector) -> float:
        """Return minus the potential energy [J] of all weights, at joint positions ``at`` (n,)."""
        frame = arm.dynamics.frames(at)[arm.flange]
        held = mass * GRAVITY @ (frame.origin + frame.axes @ local)
        return float(held - arm.dynamics.potential_energy(at, GRAVITY))

    step, expected = 1e-5, np.empty(len(q))
    for i in range(len(q)):
        ahead, behind = q.copy(), q.copy()
        ahead[i], behind[i] = q[i] + step, q[i] - step
        expected[i] = -(lift(ahead) - lift(behind)) / (2.0 * step)
    found = np.array([states[joint.name].effort for joint in arm.joints])
    return float(np.abs(found - expected).max() / np.abs(expected).max())


def _carried_mass(simulation: Simulation, result: StepResult) -> tuple[Vector, float]:
    """Return the centre of mass (3,) [m] and the mass [kg] of the hand together with the rigid bodies that it holds."""
    scene = simulation.scene
    masses = np.zeros(scene.mesh.n_vertices)
    densities = np.array([material.density for material in scene.materials.values()])[scene.cell_material]
    volumes = simulation.stepper.body.shape.volume
    np.add.at(masses, scene.mesh.cells, (densities * volumes / 8.0)[:, None])
    moment, total = masses @ result.positions, float(masses.sum())
    for each in scene.rigid_bodies:
        place = np.add(each.origin, simulation.handle_pose(each.name).translation)
        moment, total = moment + each.mass * place, total + each.mass
    return moment / total, total


@dataclass
class Account:
    """Energy balance of an arm: work of the motors, energy of the links, and work of the links on the hand.

    Attributes:
        simulation: simulation that is stepped.
        motors: sum of the magnitudes of the works of all motors and steps so far [J].
        net: work of all motors [J].
        hand: work of the handle on the hand [J].
    """

    simulation: Simulation
    motors: float = 0.0
    net: float = 0.0
    hand: float = 0.0
    _last: tuple[Vector, Vector, Vector, Vector] | None = field(default=None)
    _start: float = 0.0
    _now: float = 0.0

    @property
    def arm(self) -> Arm:
        """Arm of the scene."""
        return self.simulation.scene.arms[0]

    @property
    def gained(self) -> float:
        """Energy that the links have gained [J]."""
        return self._now - self._start

    @property
    def error(self) -> float:
        """Error of the energy balance, divided by the work of the motors."""
        return abs(self.net - self.hand - self.gained) / self.motors

    def add(self, result: StepResult) -> None:
        """Add the works of one step, by the trapezoidal rule."""
        states = list(self.simulation.joint_states().values())
        q, v, efforts = (
            np.array([getattr(state, name) for state in states]) for name in ("position", "velocity", "effort")
        )
        centre = self.arm.centre + self.simulation.targets[self.arm.handle].translation
        wrench = result.reactions[self.arm.handle]
        energy = self.arm.dynamics.kinetic_energy(q, v) + self.arm.dynamics.potential_energy(q, GRAVITY)
        turn = np.array(self.simulation.targets[self.arm.handle].rotation)
        pose = np.concatenate([centre, turn])
        if self._last is None:
            self._start = energy
        else:
            q0, efforts0, wrench0, pose0 = self._last
            works = 0.5 * (efforts + efforts0) * (q - q0)
            self.motors += float(np.abs(works).sum())
            self.net += float(works.sum())
            self.hand += float(0.5 * (wrench + wrench0) @ (pose - pose0))
        self._last, self._now = (q, efforts, wrench, pose), energy

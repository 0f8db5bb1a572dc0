# SPDX-License-Identifier: Apache-2.0
"""Readings of a simulated scene: geometry, poses, fields, actuators, joints and sensors."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from gdfe_ros.actuators import ActuatorState, total_gravity
from gdfe_ros.arms.carriers import Carriers, JointReading, Motions
from gdfe_ros.arms.dynamics import LinkFrame
from gdfe_ros.command import Orders
from gdfe_ros.constraints import Handle, Pose
from gdfe_ros.constraints.obstacle import Obstacle
from gdfe_ros.constraints.rigid_body import RigidBody
from gdfe_ros.coupling.joint_coupling import JointCoupling
from gdfe_ros.mesh import HexMesh
from gdfe_ros.results.element_fields import ElementFields, element_fields
from gdfe_ros.results.inertial_units import ImuReading, later_readings
from gdfe_ros.results.step_result import StepResult
from gdfe_ros.scene.scene import Scene
from gdfe_ros.scene.solvable import remarks
from gdfe_ros.solver.settings import Policy, SolverSettings
from gdfe_ros.solver.state import State
from gdfe_ros.solver.vectors import Array


class SceneReadings:
    """A scene with its state: geometry, commands, and readings of sensors. `Simulation` steps it."""

    scene: Scene
    settings: SolverSettings
    origin: Array
    state: State
    targets: Mapping[str, Pose]
    commands: Mapping[str, float]
    result: StepResult | None
    _orders: Orders
    _carriers: Carriers
    _coupling: JointCoupling

    @property
    def mesh(self) -> HexMesh:
        """Undeformed mesh."""
        return self.scene.mesh

    @property
    def policy(self) -> Policy:
        """Policy of the solver."""
        return self.settings.policy

    @property
    def handle_names(self) -> tuple[str, ...]:
        """Names of the handles, in the scene's order."""
        return tuple(handle.name for handle in self.scene.handles)

    @property
    def actuator_names(self) -> tuple[str, ...]:
        """Names of the actuators, in the scene's order."""
        return tuple(actuator.name for actuator in self.scene.actuators)

    @property
    def positions(self) -> Array:
        """Current vertex positions (n, 3) float64 [m], read-only."""
        own = self.state.positions[: self.mesh.n_vertices]
        positions = own + self.origin if self.origin.any() else own.view()
        positions.flags.writeable = False
        return positions

    @property
    def _rigid(self) -> list[str]:
        """Names of the rigid bodies."""
        return [body.name for body in self.scene.rigid_bodies]

    @property
    def _movable(self) -> list[str]:
        """Names of the handles and obstacles that accept commands: not fixed, not on an arm, no rigid bodies."""
        handles = [each for each in self.scene.handles if not each.fixed and not isinstance(each, RigidBody)]
        return [each.name for each in handles if not each.carrier]

    @property
    def settled(self) -> bool:
        """Whether the state stays constant without a new command."""
        still = self._carriers.have_arrived(self._joints) and self._coupling.rests(self._joints, self._links)
        return still and self.stepper.is_settled(self.state, self.targets, self.commands)

    def remarks(self) -> list[str]:
        """Return remarks on the scene, e.g. on unstable materials or contrasts beyond the policy's calibration."""
        return [*remarks(self.scene, self.policy), *self.stepper.equilibrium.remarks]

    def fields(self) -> ElementFields:
        """Return the element fields at the current positions."""
        return self.later_fields()()

    def later_fields(self) -> Callable[[], ElementFields]:
        """Return a function that computes the present state's fields, in any thread and also after further steps."""
        state = self.state
        omega = None if state.shapes is None else state.shapes.omega
        given = {"operators": state.operators, "origin": self.origin}
        return partial(element_fields, self.stepper.body, state.positions, omega, **given)

    def handle_pose(self, name: str) -> Pose:
        """Return the present pose of a handle, obstacle or rigid body, relative to its rest pose.

        A handle or obstacle is at its commanded pose; components along free axes are computed.

        Raises:
            CommandError: no such handle, obstacle or rigid body.
        """
        return self._pose(self._orders.handle(name), self.state, self.state.positions + self.origin)

    def later_poses(self) -> Callable[[], dict[str, Pose]]:
        """Return a function that computes all present poses by name, in any thread and also after further steps."""
        state = self.state

        def read() -> dict[str, Pose]:
            positions = state.positions + self.origin
            return {handle.name: self._pose(handle, state, positions) for handle in self.scene.handles}

        return read

    def _pose(self, handle: Handle, state: State, positions: Array) -> Pose:
        """Return a handle's pose in a state, whose vertices are at ``positions`` [m]."""
        if isinstance(handle, Obstacle):
            return handle.pose(state.poses[handle.name], positions)
        if handle.fixed:
            return Pose()
        moved = handle.centre(positions) - handle.centre(self.mesh.vertices)
        return Pose(tuple(moved), self.stepper.equilibrium.handles.pose(handle.name, state.poses, state.turns).rotation)

    def actuator_states(self) -> dict[str, ActuatorState]:
        """Return a dict from actuator to its command, its extent and its effort."""
        return dict(self.state.summary.actuators)

    @property
    def joint_goals(self) -> dict[str, float]:
        """Dict from joint of an arm to its commanded position [rad] or [m]."""
        return self._carriers.parts(self._joints, "goals")

    @property
    def joint_positions(self) -> dict[str, float]:
        """Dict from joint of an arm to its present position [rad] or [m]."""
        return self._carriers.parts(self._shown, "positions")

    @property
    def motor_velocities(self) -> dict[str, float]:
        """Dict from joint of an arm to its motor's mean velocity in the last step [rad/s] or [m/s]."""
        return self._carriers.parts(self._joints, "velocities")

    def link_frames(self) -> dict[str, LinkFrame]:
        """Return dict from link of an arm to its frame in the world."""
        return self._carriers.frames(self._shown)

    @property
    def _shown(self) -> Motions:
        """Motions of the joints on the side of the links; rigid joints move as their motors do."""
        return self._coupling.on_links(self._joints, self._links)

    def joint_states(self) -> dict[str, JointReading]:
        """Return dict from joint of an arm to its position, velocity and effort, and the limits that restricted it.

        The effort is the motor's torque or force. It balances the weight and the inertia of the links (recursive
        Newton-Euler algorithm), and the wrenches of the soft body and of touching rigid bodies (J^T w).
        """
        if not self._carriers:
            return {}
        contacts = self.result.contacts if self.result is not None else {}
        loaded = {"reactions": self.state.summary.reactions, "contacts": contacts}
        gravity = total_gravity(self.scene.loads, self.commands)
        return self._carriers.readings(self._shown, self.targets, **loaded, gravity=gravity, cuts=self._cuts)

    def probe_positions(self) -> dict[str, Array]:
        """Return dict from probe to its present position (3,) [m]."""
        return {name: point.at(self.positions)[0] for name, point in self.scene.probes.items()}

    def imus(self) -> dict[str, ImuReading]:
        """Return dict from probe to the reading of an inertial measurement unit; CommandError without dynamics."""
        return self.later_imus()()

    def later_imus(self) -> Callable[[], dict[str, ImuReading]]:
        """Return a function that computes the present state's readings, in any thread and also after further steps."""
        return later_readings(self.scene.probes, self.scene.loads, self.stepper, self.state, self.commands)

# SPDX-License-Identifier: Apache-2.0
"""Readings of an inertial measurement unit embedded in a body.

The unit sits at a material point and has the orientation R of its cell, from the mean deformation gradient F = R U. Let
F' be the mean gradient of the velocities. Then R^T F' = W U + U', where U' is symmetric, and the axial vector w of W =
R^T R' follows from

    (tr(U) 1 - U) w = axial(R^T F' - F'^T R),   axial(A) = (A_32, A_13, A_21).

The unit measures R^T (a - g): zero in free fall, and -R^T g at rest.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.actuators.embedding import Embedding
from gdfe_ros.actuators.load import Load, total_gravity
from gdfe_ros.errors import CommandError
from gdfe_ros.mesh.cells.operators import ShapeOperators
from gdfe_ros.solver.motion.stepper import MotionStepper
from gdfe_ros.solver.state import State
from gdfe_ros.solver.stepping.stepper import Stepper
from gdfe_ros.solver.vectors import Array


@dataclass(frozen=True, eq=False, kw_only=True)
class ImuReading:
    """Reading of one unit.

    Attributes:
        orientation: rotation from the unit's axes to the world's axes; initially the identity.
        angular_velocity: (3,) [rad/s] in the unit's axes.
        linear_acceleration: (3,) [m/s^2] in the unit's axes, minus the acceleration of gravity: 9.81 upward at rest.
    """

    orientation: Rotation
    angular_velocity: Array
    linear_acceleration: Array


def later_readings(
    points: Mapping[str, Embedding],
    loads: Iterable[Load],
    stepper: Stepper | MotionStepper,
    state: State,
    commands: Mapping[str, float],
) -> Callable[[], dict[str, ImuReading]]:
    """Return a function that returns a dict from unit name to reading.

    The function evaluates the readings once and may run in any thread. Before the first step of a run, a unit has the
    readings of a body at rest.

    Args:
        points: dict from unit name to its material point.
        loads: loads of the scene.
        stepper: stepper of the simulation.
        state: state whose readings are evaluated.
        commands: dict from load name to its factor.

    Raises:
        CommandError: the body has no mass.
    """
    if state.ledger is None:
        raise CommandError("an inertial unit needs a body with mass; remedy: give the scene the key `dynamics`")
    gravity = total_gravity(loads, commands)

    def read() -> dict[str, ImuReading]:
        motion = (state.positions, stepper.velocities(state), stepper.accelerations(state))
        reading = partial(imu_reading, stepper.body.shape, gravity=gravity)
        return {name: reading(point, *motion) for name, point in points.items()}

    return cache(read)


def imu_reading(
    shape: ShapeOperators,
    point: Embedding,
    positions: Array,
    velocities: Array,
    accelerations: Array,
    *,
    gravity: Array,
) -> ImuReading:
    """Return the reading of a unit at a material point.

    Args:
        shape: operators of the undeformed elements.
        point: position of the unit.
        positions: (n, 3) [m].
        velocities: (n, 3) [m/s].
        accelerations: (n, 3) [m/s^2].
        gravity: (3,) [m/s^2].
    """
    corners = point.corners[0]
    slopes = shape.gradient[_cell(shape, corners)]
    turn, stretch = _polar(positions[corners].T @ slopes)
    rate = turn.T @ velocities[corners].T @ slopes
    spin = np.array([rate[2, 1] - rate[1, 2], rate[0, 2] - rate[2, 0], rate[1, 0] - rate[0, 1]])
    return ImuReading(
        orientation=Rotation.from_matrix(turn),
        angular_velocity=np.linalg.solve(np.trace(stretch) * np.eye(3) - stretch, spin),
        linear_acceleration=turn.T @ (point.at(accelerations)[0] - gravity),
    )


def _cell(shape: ShapeOperators, corners: NDArray[np.int32]) -> int:
    """Return the cell with these corners (8,)."""
    near = np.flatnonzero(shape.cells[:, 0] == corners[0])
    return int(near[(shape.cells[near] == corners).all(axis=1)][0])


def _polar(gradient: Array) -> tuple[Array, Array]:
    """Return R and U (3, 3) of the deformation gradient F = R U; R is a rotation even for an inverted element."""
    left, stretches, right = np.linalg.svd(gradient)
    if np.linalg.det(left @ right) < 0.0:
        left[:, 2], stretches[2] = -left[:, 2], -stretches[2]
    return left @ right, (right.T * stretches) @ right

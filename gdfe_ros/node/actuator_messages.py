# SPDX-License-Identifier: Apache-2.0
"""Packing of what actuators do, and are to do, into ROS messages."""

from __future__ import annotations

import array
import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Header, MultiArrayDimension, MultiArrayLayout

from gdfe_ros.actuators import Actuator, Readings
from gdfe_ros.node.actuator_orders import EFFORTS
from gdfe_ros.node.step import Step
from gdfe_ros.scene.scene import Scene


class ActuatorStates:
    """Packs joint states; remembers the last step for the velocities.

    Args:
        scene: whose actuators they are of.
    """

    def __init__(self, scene: Scene) -> None:
        self._readings = Readings(scene.actuators, scene.mesh.vertices)
        self._last: tuple[float, NDArray[np.float64]] | None = None

    def message(self, head: Header, step: Step) -> JointState:
        """Pack the states of a step; velocities are over the time since the last call, 0 where none has passed."""
        states = step.actuators.values()
        positions = self._readings.positions(step.actuators)
        velocities = np.zeros(len(positions))
        if self._last is not None and step.record.time > self._last[0]:
            velocities = (positions - self._last[1]) / (step.record.time - self._last[0])
        self._last = (step.record.time, positions)
        return JointState(
            header=head,
            name=list(step.actuators),
            position=_doubles(positions),
            velocity=_doubles(velocities),
            effort=_doubles(np.array([state.effort for state in states])),
        )


def actuation(actuators: Mapping[str, Actuator], values: Mapping[str, float]) -> JointState:
    """Pack commands by name: tensions and pressures as ``effort``; all others, factors on loads too, ``position``."""
    forced = [name in actuators and actuators[name].mode in EFFORTS for name in values]
    pairs = list(zip(forced, map(float, values.values()), strict=True))
    return JointState(
        name=list(values),
        position=[math.nan if force else value for force, value in pairs],
        effort=[value if force else math.nan for force, value in pairs],
    )


def jacobian(values: NDArray[np.float64], probes: list[str], actuators: list[str]) -> Float64MultiArray:
    """Pack a Jacobian (probes, 3, actuators); the labels of the layout name probes, axes and actuators."""
    labels = (",".join(probes), "x,y,z", ",".join(actuators))
    strides = np.cumprod(values.shape[::-1])[::-1]
    dimensions = [
        MultiArrayDimension(label=label, size=size, stride=int(stride))
        for label, size, stride in zip(labels, values.shape, strides, strict=True)
    ]
    return Float64MultiArray(layout=MultiArrayLayout(dim=dimensions, data_offset=0), data=_doubles(values))


def _doubles(values: NDArray[np.float64]) -> array.array:
    return array.array("d", np.ascontiguousarray(values, dtype=np.float64).tobytes())

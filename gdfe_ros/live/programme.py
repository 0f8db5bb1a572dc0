# SPDX-License-Identifier: Apache-2.0
"""Playback of a scene's program as orders for each next step."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable

from scipy.spatial.transform import Rotation

from gdfe_ros.constraints import Pose
from gdfe_ros.node.orders import ActuatorOrder, Order, PoseOrder
from gdfe_ros.scene.program import Program


def pose_order(handle: str, pose: Pose) -> PoseOrder:
    """Return the order that moves a handle to a pose relative to its rest pose."""
    quaternion = tuple(Rotation.from_rotvec(pose.rotation).as_quat().tolist())
    return PoseOrder(handle, pose.translation, quaternion)


class Programme:
    """Plays a program from a given simulation time on, except for items that another source commands.

    One thread may call `leave` while another thread calls `give`. After `leave` has returned, no more orders for the
    given names are sent.

    Args:
        program: program of the scene.
        start: simulation time at which the program begins [s].

    Attributes:
        start: simulation time at which the program begins [s].
    """

    def __init__(self, program: Program, start: float) -> None:
        self._program, self.start = program, start
        self._left: set[str] = set()
        self._giving = threading.Lock()

    @property
    def duration(self) -> float:
        """Length of the program [s]."""
        return self._program.duration

    def leave(self, names: Iterable[str]) -> None:
        """Stop commanding the named handles, actuators, loads and joints, because another source commands them now."""
        with self._giving:
            self._left.update(names)

    def over(self, time: float) -> bool:
        """Return whether the program has ended at a simulation time [s]."""
        return time - self.start >= self._program.duration

    def give(self, time: float, send: Callable[[str, Order], None]) -> None:
        """Send the orders for a step that ends at a simulation time [s]; ``send`` receives the name and the order."""
        with self._giving:
            for name, order in self._orders(time):
                send(name, order)

    def _orders(self, time: float) -> list[tuple[str, Order]]:
        moment = time - self.start
        poses = self._program.handle_poses(moment)
        orders: list[tuple[str, Order]] = [
            (name, pose_order(name, pose)) for name, pose in poses.items() if name not in self._left
        ]
        values = self._program.actuator_values(moment) | self._program.load_factors(moment)
        values |= self._program.joint_positions(moment)
        values = {name: value for name, value in values.items() if name not in self._left}
        return [*orders, *([("program", ActuatorOrder(values))] if values else [])]

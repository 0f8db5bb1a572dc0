# SPDX-License-Identifier: Apache-2.0
"""The action ``FollowJointTrajectory``, as offered by joint_trajectory_controller, if control_msgs is installed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from trajectory_msgs.msg import JointTrajectoryPoint

from gdfe_ros.errors import GdfeError
from gdfe_ros.node.inputs import Code, Pursuit, Tolerances
from gdfe_ros.node.interface.services import FOLLOW_TRAJECTORY
from gdfe_ros.node.messages import header
from gdfe_ros.node.refusals import Reason, Refusal
from gdfe_ros.node.ros_types import LARGEST, bounded_action, installed, interface_class, unread_size
from gdfe_ros.node.services import SessionNode
from gdfe_ros.node.session import SimulationSession

_CODES = {Reason.UNKNOWN: Code.INVALID_JOINTS, Reason.STALE: Code.OLD_HEADER_TIMESTAMP}


class TrajectoryAction:
    """Accepts trajectories as goals: each is an order as on ``~/trajectory``, with feedback and a result.

    Args:
        node: node of the action.
    """

    def __init__(self, node: SessionNode) -> None:
        self._node = node
        if not installed(FOLLOW_TRAJECTORY.type):
            return
        from rclpy.action import ActionServer, CancelResponse, GoalResponse

        class Server(ActionServer):
            """A server that rejects goals that were too large to be read."""

            unread = 0

            async def execute(self, taken_data: Any) -> None:
                """Respond to requests, as rclpy does."""
                self.unread = unread_size(taken_data["goal"][1]) if "goal" in taken_data else 0
                await super().execute(taken_data)

        self._kind = interface_class(FOLLOW_TRAJECTORY.type)
        self._pursuits: dict[bytes, Pursuit] = {}
        self._action = Server(
            node,
            self._kind,
            FOLLOW_TRAJECTORY.name,
            goal_callback=lambda goal: GoalResponse.REJECT if self._too_large() else GoalResponse.ACCEPT,
            execute_callback=lambda goal: self._kind.Result(),
            handle_accepted_callback=self._accept,
            cancel_callback=lambda goal: self._cancel(goal) or CancelResponse.ACCEPT,
        )
        self._action._action_type = bounded_action(self._kind, node.get_logger().warning)

    def _too_large(self) -> bool:
        """Return whether the goal that has come was too large to be read, and log that."""
        size = self._action.unread
        if size:
            text = f"a goal of {FOLLOW_TRAJECTORY.name} is refused: it has {size} bytes; allowed: up to {LARGEST}"
            self._node.get_logger().warning(text)
        return bool(size)

    def _accept(self, goal: Any) -> None:
        """Queue the order of a goal, or end the goal at once with the reason of the refusal."""
        key = bytes(goal.goal_id.uuid)

        def finish(code: Code, reason: str) -> None:
            self._pursuits.pop(key, None)
            goal.execute(lambda goal: self._conclude(goal, code, reason))

        try:
            session = self._node.session
            if session is None or not session.stepper.running:
                raise Refusal(Reason.INACTIVE, f"the node is {self._node.lifecycle_state}; `activate` it first")
            tolerances = _tolerances(goal.request)
            order = session.inputs.trajectory(goal.request.trajectory)
            tell = _feedback(goal, self._kind, order.names, session)
            self._pursuits[key] = pursuit = Pursuit(order, tolerances, tell=tell, finish=finish)
            session.inputs.pursue(pursuit)
        except GdfeError as error:
            refusal = error if isinstance(error, Refusal) else Refusal(Reason.MALFORMED, str(error))
            if session is not None:
                session.run.refusals.refuse(FOLLOW_TRAJECTORY.name, refusal)
            finish(_CODES.get(refusal.reason, Code.INVALID_GOAL), str(refusal))

    def _cancel(self, goal: Any) -> None:
        """End a goal: keep its actuators, loads and joints at their present commands."""
        session, pursuit = self._node.session, self._pursuits.get(bytes(goal.goal_id.uuid))
        if pursuit is not None and session is not None:
            session.inputs.hold(pursuit)
        if pursuit is not None:
            pursuit.end(Code.INVALID_GOAL, "it was cancelled")

    def _conclude(self, goal: Any, code: Code, reason: str) -> Any:
        if code is Code.SUCCESSFUL:
            goal.succeed()
        else:
            (goal.canceled if goal.is_cancel_requested else goal.abort)()
        return self._kind.Result(error_code=int(code), error_string=reason)


def _tolerances(request: Any) -> Tolerances:
    """Return a goal's tolerances of positions, which are commands here; a value of 0 or -1 sets no tolerance.

    Tolerances of velocities and accelerations are ignored.

    Raises:
        Refusal: the goal has a multi-DOF trajectory, or a trajectory without points; or a tolerance is not finite, or
            is for a name that the trajectory does not command.
    """
    if request.multi_dof_trajectory.joint_names or request.multi_dof_trajectory.points:
        raise Refusal(
            Reason.MALFORMED,
            "multi_dof_trajectory is not empty; remedy: put commands of actuators and loads into trajectory",
        )
    if not request.trajectory.points:
        raise Refusal(Reason.WRONG_SIZE, "the trajectory has no points; cancel a goal to end it")
    for each in (*request.path_tolerance, *request.goal_tolerance):
        if each.name not in request.trajectory.joint_names:
            raise Refusal(Reason.UNKNOWN, f"a tolerance is for {each.name!r}, which the trajectory does not command")
        if not np.isfinite(each.position):
            raise Refusal(Reason.NOT_FINITE, f"the tolerance of {each.name} is {each.position!r}; allowed: numbers")
    path, goal = (
        {each.name: each.position for each in given if each.position > 0.0}
        for given in (request.path_tolerance, request.goal_tolerance)
    )
    leeway = request.goal_time_tolerance
    return Tolerances(path, goal, leeway.sec + 1e-9 * leeway.nanosec)


def _feedback(
    goal: Any, kind: Any, names: tuple[str, ...], session: SimulationSession
) -> Callable[[float, NDArray[np.float64], NDArray[np.float64]], None]:
    """Return a function that sends feedback about each step to a goal's client."""

    def tell(elapsed: float, desired: NDArray[np.float64], actual: NDArray[np.float64]) -> None:
        points = [JointTrajectoryPoint(positions=values.tolist()) for values in (desired, actual, desired - actual)]
        for point in points:
            point.time_from_start.sec, point.time_from_start.nanosec = divmod(round(1e9 * elapsed), 10**9)
        head = header(session.run.last.record.stamp, session.run.frames.frame_id)
        told = dict(zip(("desired", "actual", "error"), points, strict=True))
        goal.publish_feedback(kind.Feedback(header=head, joint_names=list(names), **told))

    return tell

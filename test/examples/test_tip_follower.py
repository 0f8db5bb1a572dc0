# SPDX-License-Identifier: Apache-2.0
"""The node that turns goals into commands, on the topics of a real simulation node."""

from __future__ import annotations

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.parameter import Parameter

from gdfe_ros.examples.tip_follower import TipFollower
from gdfe_ros.testing import Simulator


def goal_at(place: np.ndarray, frame: str = "") -> PoseStamped:
    """Return a goal."""
    message = PoseStamped()
    message.header.frame_id = frame
    message.pose.position.x, message.pose.position.y, message.pose.position.z = place.tolist()
    return message


def test_a_goal_becomes_commands() -> None:
    """The tip goes to a sent goal; a goal in a wrong frame and one out of reach are reported with reasons."""
    with Simulator("tendon_finger", inputs=["actuation"]) as simulator:
        tip = np.array(simulator.state.probes["tip"].translation)
        parameters = [Parameter("simulation", value=simulator.name)]
        node = TipFollower(context=simulator.context, parameter_overrides=parameters)
        sender = rclpy.create_node("sender", context=simulator.context)
        goals = sender.create_publisher(PoseStamped, "/tip_follower/goal", 10)
        aim = tip + np.array([0.0, 0.0, 4e-3])
        timer = node.create_timer(0.1, lambda: goals.publish(goal_at(tip, "camera")) or goals.publish(goal_at(aim)))
        states = simulator.spin(node, steps=20)
        timer.cancel()
        away = np.abs(np.array(states[-1].probes["tip"].translation) - aim)
        assert away[2] < 1e-4
        node.create_timer(0.1, lambda: goals.publish(goal_at(tip + np.array([0.2, 0.0, 0.0]))))
        while not node.message:  # the goal takes a while; lockstep does not
            simulator.spin(node, steps=5)
        assert "nearest point so far, from the goal: tip" in node.message
        node.destroy_node()
        sender.destroy_node()

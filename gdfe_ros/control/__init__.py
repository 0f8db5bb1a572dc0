# SPDX-License-Identifier: Apache-2.0
"""Inverse control: actuator commands that bring probe positions, probe orientations and contact forces to goals."""

from gdfe_ros.control.feedback import FeedbackControl
from gdfe_ros.control.inverse import InverseControl, Reach
from gdfe_ros.control.real_time import RealTimeControl
from gdfe_ros.control.targets import ForceTarget, OrientationTarget, Target

__all__ = [
    "FeedbackControl",
    "ForceTarget",
    "InverseControl",
    "OrientationTarget",
    "Reach",
    "RealTimeControl",
    "Target",
]

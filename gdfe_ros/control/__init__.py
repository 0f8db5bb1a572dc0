# SPDX-License-Identifier: Apache-2.0
"""Inverse control: actuator commands from goals for positions and orientations of probes and for contact forces."""

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

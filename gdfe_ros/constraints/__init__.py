# SPDX-License-Identifier: Apache-2.0
"""Constraints on a body: handles, obstacles, rigid bodies and their shapes, and poses."""

from gdfe_ros.constraints.handle import Axis, Handle
from gdfe_ros.constraints.pose import Pose, nearest_turn

__all__ = ["Axis", "Handle", "Pose", "nearest_turn"]

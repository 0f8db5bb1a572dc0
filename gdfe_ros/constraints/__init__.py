# SPDX-License-Identifier: Apache-2.0
"""Handles: sets of vertices that are fixed, or move together as a rigid body."""

from gdfe_ros.constraints.handle import Axis, Handle
from gdfe_ros.constraints.pose import Pose, nearest_turn

__all__ = ["Axis", "Handle", "Pose", "nearest_turn"]

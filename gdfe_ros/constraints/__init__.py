# SPDX-License-Identifier: Apache-2.0
"""Handles: sets of vertices that are held, or move together as one rigid piece."""

from gdfe_ros.constraints.handle import Axis, Handle
from gdfe_ros.constraints.pose import Pose
from gdfe_ros.constraints.turn import nearest_turn

__all__ = ["Axis", "Handle", "Pose", "nearest_turn"]

# SPDX-License-Identifier: Apache-2.0
"""Number of increments into which a command is divided before the first solve."""

from __future__ import annotations

import math
from collections.abc import Mapping

from gdfe_ros.constraints import Pose

LARGEST_TURN = math.radians(100.0)
"""Largest rotation of a handle in one increment [rad]."""


def planned_increments(targets: Mapping[str, Pose], poses: Mapping[str, Pose], size: float) -> int:
    """Return the number of increments. In each, a handle turns by at most `LARGEST_TURN` and moves by at most ``size``.

    Args:
        targets: pose of every handle.
        poses: present poses of the handles.
        size: size of the body [m].
    """
    most = 1.0
    for name, target in targets.items():
        if target == poses[name]:
            continue
        turn = math.dist(target.rotation, poses[name].rotation)
        shift = math.dist(target.translation, poses[name].translation)
        most = max(most, turn / LARGEST_TURN, shift / size)
    return math.ceil(most)

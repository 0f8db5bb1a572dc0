# SPDX-License-Identifier: Apache-2.0
"""Into how many increments a command is cut before anything is solved."""

from __future__ import annotations

import math
from collections.abc import Mapping

from gdfe_ros.constraints import Pose

LARGEST_TURN = math.radians(100.0)
LARGEST_SHIFT = 1.0
"""Of the body's size: farther motions are cut."""


def planned_increments(targets: Mapping[str, Pose], poses: Mapping[str, Pose], size: float) -> int:
    """Return the increments with which no handle turns or shifts too far from ``poses`` to ``targets`` in one of them.

    Args:
        targets: of every handle.
        poses: where the handles are.
        size: of the body [m].
    """
    most = 1.0
    for name, target in targets.items():
        if target == poses[name]:
            continue
        turn = math.dist(target.rotation, poses[name].rotation)
        shift = math.dist(target.translation, poses[name].translation)
        most = max(most, turn / LARGEST_TURN, shift / (LARGEST_SHIFT * size))
    return math.ceil(most)

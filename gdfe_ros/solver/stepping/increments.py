# SPDX-License-Identifier: Apache-2.0
"""Into how many increments a command is cut before anything is solved."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gdfe_ros.constraints import Pose

LARGEST_TURN = np.deg2rad(100.0)
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
        turn = np.linalg.norm(np.subtract(target.rotation, poses[name].rotation))
        shift = np.linalg.norm(np.subtract(target.translation, poses[name].translation))
        most = max(most, turn / LARGEST_TURN, shift / (LARGEST_SHIFT * size))
    return int(np.ceil(most))

# SPDX-License-Identifier: Apache-2.0
"""Linear paths of poses and commands from the beginning of a step to its end."""

from __future__ import annotations

from collections.abc import Mapping

from gdfe_ros.constraints import Pose

Place = tuple[Mapping[str, Pose], Mapping[str, float]]
"""Dict from handle or obstacle to its pose, and dict from actuator or load to its command."""


def on_path(began: Place, goal: Place, share: float) -> Place:
    """Return the poses and commands at a ``share`` of the linear path; from 1 on they are those of ``goal``."""
    if share >= 1.0:
        return goal
    poses = {name: began[0][name].blend(target, share) for name, target in goal[0].items()}
    return poses, {name: value + share * (goal[1][name] - value) for name, value in began[1].items()}

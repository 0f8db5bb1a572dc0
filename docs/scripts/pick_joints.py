# SPDX-License-Identifier: Apache-2.0
"""Joint positions of the scenes `pick_ur5e` and `pick_panda`: ``python -m docs.scripts.pick_joints`` prints them.

The flange is over the box, goes down, stays while the hand closes, and so on: `WAYS` has its positions over time.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from gdfe_ros.arms.arm import Arm
from gdfe_ros.scene import load_scene

DOWN = np.diag([1.0, -1.0, -1.0])
"""Axes of the flange: its z axis points down."""
X, HIGH, LOW = 0.45, 0.17, 0.093
"""Distance of the objects from the arm's base, and heights of the flange over and at an object [m]."""
BOX, MIDDLE, CUBE = 0.14, 0.02, -0.14
"""Positions along y [m]: of the box, of its next place, and of the cube, which goes where the box was."""
SET = LOW + 0.0005
"""Height [m] of the flange at which an object is put down: the weight has bent the fingers."""
WAYS: tuple[tuple[float, float, float], ...] = (
    (0.0, BOX, HIGH), (0.8, BOX, LOW), (2.3, BOX, LOW), (3.1, BOX, HIGH), (4.1, MIDDLE, HIGH), (4.9, MIDDLE, SET),
    (5.5, MIDDLE, SET), (6.1, MIDDLE, HIGH), (7.1, CUBE, HIGH), (7.8, CUBE, LOW), (9.3, CUBE, LOW), (10.1, CUBE, HIGH),
    (11.3, BOX, HIGH), (12.3, BOX, HIGH), (13.1, BOX, SET), (13.7, BOX, SET), (14.3, BOX, HIGH),
)  # fmt: skip
"""Time [s], y and height [m] of the flange."""
OFFSETS = {"pick_ur5e": 0.0, "pick_panda": -0.01}
"""Dict from scene to the height [m] that is added, the flange is nearer to the fingers of its hand."""
GUESSES = {
    "pick_ur5e": [0.0, -1.57, 1.57, -1.57, -1.57, -1.57],
    "pick_panda": [0.0, 0.3, 0.0, -2.2, 0.0, 2.5, 0.8, 0.04],
}


def solve_joints(arm: Arm, at: tuple[float, float, float], guess: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return joint positions (n,) [rad] near a guess that put the flange ``at`` a position [m], with the axes `DOWN`.

    Raises:
        ValueError: the arm does not reach it.
    """
    limits = [joint.limits for joint in arm.joints]

    def distance(q: NDArray[np.float64]) -> NDArray[np.float64]:
        frame = arm.dynamics.frames(q)[arm.flange]
        near = 1e-3 * (q - guess) if len(q) > 6 else np.zeros(0)  # a seventh joint stays near its guess
        return np.concatenate([10.0 * (frame.origin - at), (frame.axes - DOWN).ravel(), near])

    bounds = [limit.lower for limit in limits], [limit.upper for limit in limits]
    found = least_squares(distance, guess, bounds=bounds, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    if np.abs(found.fun[:12]).max() > 1e-5:
        raise ValueError(f"the arm {arm.name} does not reach {at}")
    return found.x


def joints_of(name: str) -> dict[str, list[tuple[float, float]]]:
    """Return a dict from joint to its times [s] and positions [rad], without points amid a pause."""
    arm = load_scene(name).arms[0]
    guess = np.array(GUESSES[name])
    rows = [solve_joints(arm, (X, y, z + OFFSETS[name]), guess) for _, y, z in WAYS]
    table = {joint.name: np.round(np.array(rows)[:, i], 5) for i, joint in enumerate(arm.joints)}
    times = [way[0] for way in WAYS]
    return {joint: [(t, float(v)) for t, v in zip(times, values, strict=True)] for joint, values in table.items()}


def main() -> None:
    """Print the start and the program of each scene."""
    for name in GUESSES:
        print(f"# {name}")
        for joint, points in joints_of(name).items():
            entries = [f"{{time: {t:g}, value: {v:g}}}" for t, v in points]
            print(f"    {joint}:")
            for i in range(0, len(entries), 3):
                row = ", ".join(entries[i : i + 3])
                print(f"      {'[' if i == 0 else ' '}{row}{']' if i + 3 >= len(entries) else ','}")


if __name__ == "__main__":
    main()

# SPDX-License-Identifier: Apache-2.0
"""A policy that reaches random goals in a Gymnasium environment; it needs no training, but estimates a Jacobian.

python -m gdfe_ros.examples.reach_policy --episodes 3
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import ArrayLike, NDArray

from gdfe_ros.examples.tip_tracker import TipTracker
from gdfe_ros.testing import make_env

_TRIAL = 0.05
"""Trial change of each command, divided by the command's range."""
_CAREFUL = {"gain": 0.5, "reach": 0.005, "baseline": 1e-4}
"""Options of `TipTracker`. A command covers half of the distance to the goal, at most 5 mm. Motions below 0.1 mm do not
correct the Jacobian.
"""
FINGER = {"actuators.flexor.cable.range": [0.0, 5.0], "actuators.extensor.cable.range": [0.0, 5.0]}
"""Overrides of ``tendon_finger``: ranges of tensions that bend the finger without rolling it up."""


class ReachPolicy:
    """Policy that changes each command once to estimate a Jacobian, and corrects this Jacobian in each later step.

    Its input is the default observation of `make_env`, as for a learnt policy. The observation begins with the tip's
    position, and ends with the commands in force, the efforts and the goal. The commands in force may lag behind the
    requested commands.

    Args:
        actions: action space of the environment.
    """

    def __init__(self, actions: Box) -> None:
        self._low, self._high = np.asarray(actions.low), np.asarray(actions.high)
        self._tips: list[NDArray[np.float64]] = []
        self._tracker: TipTracker | None = None
        self._last = np.clip(np.zeros_like(self._low), self._low, self._high)

    def act(self, seen: ArrayLike) -> NDArray[np.float64]:
        """Return the action, the commands (a,), for an observation."""
        seen = np.asarray(seen, dtype=np.float64)
        tip, goal, count = seen[:3], seen[-3:], len(self._low)
        if len(self._tips) <= count:
            self._tips.append(tip)
            tried = len(self._tips) - 1
            if tried < count:
                self._last = self._last.copy()
                self._last[tried] += _TRIAL * (self._high - self._low)[tried]
                return self._last
            columns = np.diff(np.array(self._tips), axis=0).T / (_TRIAL * (self._high - self._low))
            self._tracker = TipTracker(columns, self._last, low=self._low, high=self._high, **_CAREFUL)
        applied = seen[-3 - 2 * count : -3 - count]
        self._last = self._tracker.command(tip, goal, applied)
        return self._last


def reach(
    scene: str | Path, *, seed: int, steps: int = 40, overrides: Mapping[str, Any] | None = None
) -> tuple[float, float]:
    """Run an episode; return the initial and the final distance of the tip from the goal [m]."""
    env = make_env(scene, steps=steps, overrides=overrides)
    policy = ReachPolicy(env.action_space)
    seen, _ = env.reset(seed=seed)
    start = float(np.linalg.norm(seen[:3] - seen[-3:]))
    truncated = False
    while not truncated:
        seen, reward, _, truncated, info = env.step(policy.act(seen))
    if not info["converged"]:
        print(f"the episode ended early: {info['why']}")
    return start, -reward


def main() -> None:
    """Run some episodes, and print the initial and final distances of the tip from the goals."""
    parser = argparse.ArgumentParser(description="A policy that reaches random goals without training.")
    parser.add_argument("--episodes", type=int, default=3)
    for seed in range(parser.parse_args().episodes):
        start, end = reach("tendon_finger", seed=seed, overrides=FINGER)
        print(f"goal {seed}: from {1e3 * start:.2f} mm to {1e3 * end:.3f} mm")


if __name__ == "__main__":
    main()

# SPDX-License-Identifier: Apache-2.0
"""A scene as an environment of Gymnasium: commands are actions, probes and actuators are observed. Needs no ROS."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import Env
from gymnasium.spaces import Box, Space
from gymnasium.vector import AsyncVectorEnv
from numpy.typing import ArrayLike, NDArray

from gdfe_ros.errors import CommandError, GdfeError
from gdfe_ros.scene import Scene, load_scene
from gdfe_ros.simulation import Command, Simulation

Observation = Callable[[Simulation], ArrayLike]
Reward = Callable[[Simulation, NDArray[np.float64]], float]
Ending = Callable[[Simulation], bool]

_DRAWS = 10
"""Goals that are drawn before it is given up to find one that a command reaches."""
_LONG = 1e9
"""Time [s] in which every rate limit lets every command through."""


class SoftRobotEnv(Env):
    """A simulation in lockstep: each step follows one command for ``dt``.

    Actions are commands of all actuators, in the scene's order and in the units of their modes; numbers beyond a range
    count as its end. Made by `make_env`.

    Attributes:
        simulation: that is stepped; to be read, not to be stepped.
        goal: (3,) where the first probe shall be [m], with the reward that this class has by itself; else None.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012  gymnasium's own declaration

    def __init__(
        self,
        scene: Scene,
        *,
        observation: Observation | None,
        reward: Reward | None,
        terminated: Ending | None,
        observation_space: Space | None,
        dt: float,
        steps: int,
    ) -> None:
        self._names = _require_ranges(scene)
        _require_numbers(dt=dt, steps=steps)
        if (observation is None or reward is None) and not scene.probes:
            raise GdfeError(
                f"scene {scene.name!r} has no probes, which are observed and led to a goal where nothing else is said; "
                "add the key 'probes', or give observation and reward"
            )
        self.simulation = Simulation(scene)
        self.goal: NDArray[np.float64] | None = None
        self._observe, self._reward, self._ends = observation or self._seen, reward, terminated
        self._dt, self._most, self._count = dt, steps, 0
        # A body with mass swings on its way: where a command leads is asked of the same body without inertia.
        self._still = Simulation(replace(scene, dynamics=None)) if reward is None else None
        if reward is None:
            self.goal = np.zeros(3)
        ranges = [(actuator.low, actuator.high) for actuator in scene.actuators]
        self._low, self._high = np.array(ranges, dtype=np.float64).T
        self.action_space = Box(self._low, self._high, dtype=np.float64)
        self.observation_space = observation_space or Box(-np.inf, np.inf, self._observation().shape, np.float64)

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[NDArray[np.float64], dict[str, Any]]:
        """Go back to rest, and draw a goal.

        Args:
            seed: of the goals; None: goes on with those of the last seed.
            options: ``goal``, (3,) [m], instead of one that is drawn.
        """
        super().reset(seed=seed)
        self.simulation.reset()
        self._count = 0
        if self._still is not None:
            given = (options or {}).get("goal")
            self.goal = self._draw() if given is None else _goal(given)
        return self._observation(), {"time": 0.0}

    def step(self, action: ArrayLike) -> tuple[NDArray[np.float64], float, bool, bool, dict[str, Any]]:
        """Follow a command for ``dt``.

        A step that did not converge truncates the episode, as does the last one; ``info["why"]`` says which it was.

        Raises:
            CommandError: the action has another shape, or a number is not finite; the state is unchanged.
        """
        given = np.asarray(action, dtype=np.float64)
        if given.shape != self._low.shape or not np.isfinite(given).all():
            raise CommandError(f"the action is {action!r}; allowed: {len(self._low)} finite numbers, {self._names}")
        given = np.clip(given, self._low, self._high)
        command = Command(actuators=dict(zip(self._names, given.tolist(), strict=True)))
        result = self.simulation.step(command, dt=self._dt)
        self._count += 1
        info = {"time": result.time, "converged": result.converged, "iterations": result.iterations}
        truncated = not result.converged or self._count >= self._most
        if truncated:
            info["why"] = f"not converged: {result.message}" if not result.converged else f"{self._most} steps are over"
        ended = self._ends is not None and bool(self._ends(self.simulation))
        return self._observation(), self._rewarded(given), ended, truncated, info

    def _observation(self) -> NDArray[np.float64]:
        return np.asarray(self._observe(self.simulation), dtype=np.float64)

    def _seen(self, simulation: Simulation) -> NDArray[np.float64]:
        """Observe probes [m], commands in force of the actuators and what they exert [N], [Pa], and the goal [m]."""
        states = simulation.actuator_states().values()
        parts = [*simulation.probe_positions().values(), [state.command for state in states]]
        parts += [[state.effort for state in states], [] if self.goal is None else self.goal]
        return np.concatenate([np.asarray(part, dtype=np.float64) for part in parts])

    def _rewarded(self, action: NDArray[np.float64]) -> float:
        if self._reward is not None:
            return float(self._reward(self.simulation, action))
        return -float(np.linalg.norm(_tip(self.simulation) - self.goal))

    def _draw(self) -> NDArray[np.float64]:
        """Give where the first probe is under some command within the ranges: a goal that can be reached.

        Raises:
            GdfeError: no command that was drawn has an equilibrium.
        """
        for _ in range(_DRAWS):
            values = self.np_random.uniform(self._low, self._high).tolist()
            self._still.reset()
            result = self._still.step(Command(actuators=dict(zip(self._names, values, strict=True))), dt=_LONG)
            if result.converged:
                return _tip(self._still)
        raise GdfeError(f"{_DRAWS} commands were drawn, and none converged; the last: {result.message}")


def make_env(
    scene: str | Path | Scene,
    *,
    observation: Observation | None = None,
    reward: Reward | None = None,
    terminated: Ending | None = None,
    observation_space: Space | None = None,
    overrides: Mapping[str, Any] | None = None,
    dt: float = 0.05,
    steps: int = 200,
) -> SoftRobotEnv:
    """Make an environment of a scene.

    Args:
        scene: name, path, or as loaded.
        observation: gives an array of the simulation; None: probes, actuators, and the goal where there is one.
        reward: gives a number of the simulation and the action (clipped); None: minus the distance [m] of the first
            probe to a goal, which is drawn at each reset among those that commands reach.
        terminated: tells whether an episode has come to its end; None: never.
        observation_space: None: numbers without bounds, of the shape of the observation at rest.
        overrides: over the scene, by dotted key.
        dt: simulation time of a step [s].
        steps: after which an episode is truncated.

    Raises:
        GdfeError: the scene has no actuators, one of them has no range, or it has no probes and these are needed.

    Example:
        >>> env = make_env("tendon_finger")
        >>> seen, _ = env.reset(seed=0)
        >>> seen, reward, terminated, truncated, info = env.step(env.action_space.sample())
    """
    loaded = scene if isinstance(scene, Scene) else load_scene(scene, overrides=overrides)
    given = {"observation": observation, "reward": reward, "terminated": terminated}
    return SoftRobotEnv(loaded, **given, observation_space=observation_space, dt=dt, steps=steps)


def make_vector_env(scene: str | Path, count: int, *, context: str = "spawn", **options: Any) -> AsyncVectorEnv:
    """Make environments that run at the same time, each in a process of its own.

    Args:
        scene: name or path.
        count: of the environments.
        context: how processes are begun; ``fork`` would take the compiler's threads along half.
        options: of `make_env`.
    """
    return AsyncVectorEnv([partial(make_env, scene, **options)] * count, context=context)


def _tip(simulation: Simulation) -> NDArray[np.float64]:
    """Give where the first probe is (3,) [m]."""
    return next(iter(simulation.probe_positions().values()))


def _goal(given: ArrayLike) -> NDArray[np.float64]:
    goal = np.array(given, dtype=np.float64)
    if goal.shape != (3,) or not np.isfinite(goal).all():
        raise GdfeError(f"the goal is {given!r}; allowed: three finite numbers [m]")
    return goal


def _require_ranges(scene: Scene) -> list[str]:
    """Name the actuators of a scene, each of which must have a range."""
    if not scene.actuators:
        raise GdfeError(f"scene {scene.name!r} has no actuators, so that there are no actions; add the key 'actuators'")
    endless = [item.name for item in scene.actuators if not math.isfinite(item.high - item.low)]
    if endless:
        raise GdfeError(f"actuators {', '.join(endless)} of scene {scene.name!r} have no range; add their key 'range'")
    return [actuator.name for actuator in scene.actuators]


def _require_numbers(*, dt: float, steps: int) -> None:
    if not (math.isfinite(dt) and dt > 0.0):
        raise GdfeError(f"dt is {dt!r}; allowed: above 0 s")
    if not (isinstance(steps, int) and steps >= 1):
        raise GdfeError(f"steps is {steps!r}; allowed: 1 or more")

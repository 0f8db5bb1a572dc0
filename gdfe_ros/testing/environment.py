# SPDX-License-Identifier: Apache-2.0
"""A scene as an environment of Gymnasium: actions are commands, observations are probes and actuators. Needs no ROS."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from numbers import Integral
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
from gdfe_ros.solver.result import StepResult

Observation = Callable[[Simulation], ArrayLike]
Reward = Callable[[Simulation, NDArray[np.float64]], float]
Ending = Callable[[Simulation], bool]

_WALK = 5
"""Largest number of steps towards a new goal in one reset: bounds the time of a reset."""
_LONG = 1e9
"""Time of a step [s] so long that no rate limit cuts a command."""
_SHARES = (1.0, 0.5, 0.25, 0.125, 0.0)
"""Fractions of the change of the commands, tried in this order until a step converges."""
_BUDGET = 400
"""Limit of iterations of a step without dynamics, after which a smaller fraction is tried; most steps need 20 to
150."""


class SoftRobotEnv(Env):
    """Gymnasium environment of a simulation in lockstep: each step applies one action for ``dt``. Made by `make_env`.

    An action holds the commands of all actuators, in the scene's order and in the units of their modes; values outside
    an actuator's range are clipped. In one step a command changes by at most range * dt / slew_time, and by less if the
    step does not converge otherwise; ``info["applied"]`` holds the applied commands.

    Attributes:
        simulation: the simulation, for reading only; `step` advances it.
        goal: (3,) goal of the first probe [m], used by the default reward; None with a reward function.
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
        slew_time: float,
    ) -> None:
        self._names = _require_ranges(scene)
        _require_numbers(dt=dt, steps=steps, slew_time=slew_time)
        if (observation is None or reward is None) and not scene.probes:
            raise GdfeError(
                f"scene {scene.name!r} has no probes, which the default observation and reward need; "
                "add the key 'probes', or give observation and reward"
            )
        self.simulation = Simulation(scene)
        self.goal: NDArray[np.float64] | None = None
        self._observe, self._reward, self._ends = observation or self._seen, reward, terminated
        self._dt, self._most, self._count = dt, steps, 0
        self._walker = _walker(scene) if reward is None else None
        if reward is None:
            self.goal = np.zeros(3)
        ranges = [(actuator.low, actuator.high) for actuator in scene.actuators]
        self._low, self._high = np.array(ranges, dtype=np.float64).T
        self._reach = (self._high - self._low) * (dt / slew_time if slew_time else np.inf)
        self.action_space = Box(self._low, self._high, dtype=np.float64)
        self.observation_space = observation_space or Box(-np.inf, np.inf, self._observation().shape, np.float64)

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[NDArray[np.float64], dict[str, Any]]:
        """Return to the rest state and draw a goal.

        Args:
            seed: of the random goals; None: continue the sequence of the last seed.
            options: ``goal``, (3,) [m], replaces the random goal.
        """
        super().reset(seed=seed)
        self.simulation.reset()
        self._count = 0
        if self._walker is not None:
            if seed is not None:
                self._walker.reset()
            given = (options or {}).get("goal")
            self.goal = self._draw() if given is None else _goal(given)
        return self._observation(), {"time": 0.0}

    def step(self, action: ArrayLike) -> tuple[NDArray[np.float64], float, bool, bool, dict[str, Any]]:
        """Apply an action for ``dt``.

        The episode is truncated by a step that did not converge and by the last step; ``info["why"]`` holds the reason.

        Raises:
            CommandError: the action has the wrong shape, or a value is not finite; the state is unchanged.
        """
        given = np.asarray(action, dtype=np.float64)
        if given.shape != self._low.shape or not np.isfinite(given).all():
            raise CommandError(f"the action is {action!r}; allowed: {len(self._low)} finite numbers, {self._names}")
        given = np.clip(given, self._low, self._high)
        result = self._approach(self.simulation, given, self._dt, _SHARES)
        self._count += 1
        info = {"time": result.time, "converged": result.converged, "iterations": result.iterations}
        info["applied"] = self._applied(self.simulation)
        truncated = not result.converged or self._count >= self._most
        if truncated:
            info["why"] = f"not converged: {result.message}" if not result.converged else f"{self._most} steps are over"
        ended = self._ends is not None and bool(self._ends(self.simulation))
        return self._observation(), self._rewarded(given), ended, truncated, info

    def _approach(
        self, simulation: Simulation, wanted: NDArray[np.float64], dt: float, shares: Sequence[float]
    ) -> StepResult:
        """Step towards the commands ``wanted``, with the first of ``shares`` that converges.

        If none converges, the result of the last share stays.
        """
        present, before = self._applied(simulation), simulation.snapshot()
        change = np.clip(wanted - present, -self._reach, self._reach)
        for share in shares:
            if share != shares[0]:
                simulation.restore(before)
            values = np.clip(present + share * change, self._low, self._high).tolist()
            command = Command(actuators=dict(zip(self._names, values, strict=True)))
            # No limit of iterations for the last attempt, nor for a scene with dynamics.
            budget = _BUDGET if share and not simulation.scene.dynamics else None
            result = simulation.step(command, dt=dt, cut_after=budget)
            if result.converged:
                break
        return result

    def _applied(self, simulation: Simulation) -> NDArray[np.float64]:
        """Return the commands applied in the last step, (actuators,)."""
        return np.array([simulation.commands[name] for name in self._names], dtype=np.float64)

    def _observation(self) -> NDArray[np.float64]:
        return np.asarray(self._observe(self.simulation), dtype=np.float64)

    def _seen(self, simulation: Simulation) -> NDArray[np.float64]:
        """Return the default observation: probe positions [m], actuator commands, efforts [N] or [Pa], and goal [m]."""
        states = simulation.actuator_states().values()
        parts = [*simulation.probe_positions().values(), [state.command for state in states]]
        parts += [[state.effort for state in states], [] if self.goal is None else self.goal]
        return np.concatenate([np.asarray(part, dtype=np.float64) for part in parts])

    def _rewarded(self, action: NDArray[np.float64]) -> float:
        if self._reward is not None:
            return float(self._reward(self.simulation, action))
        return -float(np.linalg.norm(_tip(self.simulation) - self.goal))

    def _draw(self) -> NDArray[np.float64]:
        """Return a reachable goal (3,) [m]: the first probe's position after some steps towards a random command.

        The steps start at the last goal; they end at ``_WALK`` steps or before the first one that does not converge.
        """
        start, wanted = self._applied(self._walker), self.np_random.uniform(self._low, self._high)
        steps = max(1.0, np.ceil(np.max(np.abs(wanted - start) / np.maximum(self._reach, np.finfo(float).tiny))))
        dt = self._dt if self._walker.scene.dynamics else _LONG
        for count in range(1, int(min(steps, _WALK)) + 1):
            before = self._walker.snapshot()
            if not self._approach(self._walker, start + count / steps * (wanted - start), dt, (1.0,)).converged:
                self._walker.restore(before)
                break
        return _tip(self._walker)


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
    slew_time: float = 1.0,
) -> SoftRobotEnv:
    """Make an environment of Gymnasium from a scene.

    Args:
        scene: name, path, or loaded scene.
        observation: function of the simulation that returns an array; None: probes, actuators, and the goal if any.
        reward: function of the simulation and the clipped action that returns a number; None: minus the distance [m] of
            the first probe from a goal. Each reset draws a goal: the position of the probe after a few steps towards a
            random command, starting at rest if a seed is given, else at the last goal. A scene with handles is
            stepped there without dynamics, one without handles with its dynamics.
        terminated: function of the simulation, true at the end of an episode; None: never.
        observation_space: None: unbounded, with the shape of the observation at rest.
        overrides: values that replace those of the scene, by dotted key; its program is not played.
        dt: simulation time of a step [s].
        steps: number of steps after which an episode is truncated.
        slew_time: shortest simulation time in which a command crosses its whole range [s]; 0: at once.

    Raises:
        GdfeError: the scene has no actuators, an actuator has no range, or probes are needed and missing.

    Example:
        >>> env = make_env("tendon_finger")
        >>> seen, _ = env.reset(seed=0)
        >>> seen, reward, terminated, truncated, info = env.step(env.action_space.sample())
    """
    # Actions replace the program, whose commands may lie outside of a narrowed range.
    loaded = scene if isinstance(scene, Scene) else load_scene(scene, overrides={**(overrides or {}), "program": None})
    given = {"observation": observation, "reward": reward, "terminated": terminated}
    return SoftRobotEnv(loaded, **given, observation_space=observation_space, dt=dt, steps=steps, slew_time=slew_time)


def make_vector_env(scene: str | Path, count: int, *, context: str = "spawn", **options: Any) -> AsyncVectorEnv:
    """Make environments that run in parallel, each in a process of its own.

    Args:
        scene: name or path.
        count: number of environments.
        context: start method of the processes; ``fork`` would copy the threads of the compiler in an invalid state.
        options: keyword arguments of `make_env`.
    """
    return AsyncVectorEnv([partial(make_env, scene, **options)] * count, context=context)


def _walker(scene: Scene) -> Simulation:
    """Return the simulation that finds goals: without dynamics, which would oscillate, if the scene has handles."""
    held = any(handle.section == "handles" for handle in scene.handles)
    return Simulation(replace(scene, dynamics=None) if held else scene)


def _tip(simulation: Simulation) -> NDArray[np.float64]:
    """Return the position of the first probe, (3,) [m]."""
    return next(iter(simulation.probe_positions().values()))


def _goal(given: ArrayLike) -> NDArray[np.float64]:
    goal = np.array(given, dtype=np.float64)
    if goal.shape != (3,) or not np.isfinite(goal).all():
        raise GdfeError(f"the goal is {given!r}; allowed: three finite numbers [m]")
    return goal


def _require_ranges(scene: Scene) -> list[str]:
    """Return the names of the actuators; raise ``GdfeError`` if there is none or one has no range."""
    if not scene.actuators:
        raise GdfeError(f"scene {scene.name!r} has no actuators, so that there are no actions; add the key 'actuators'")
    endless = [item.name for item in scene.actuators if not math.isfinite(item.high - item.low)]
    if endless:
        raise GdfeError(f"actuators {', '.join(endless)} of scene {scene.name!r} have no range; add their key 'range'")
    return [actuator.name for actuator in scene.actuators]


def _require_numbers(*, dt: float, steps: int, slew_time: float) -> None:
    if not (math.isfinite(dt) and dt > 0.0):
        raise GdfeError(f"dt is {dt!r}; allowed: above 0 s")
    if not (math.isfinite(slew_time) and slew_time >= 0.0):
        raise GdfeError(f"slew_time is {slew_time!r}; allowed: 0 s or more")
    if not (isinstance(steps, Integral) and not isinstance(steps, bool) and steps >= 1):
        raise GdfeError(f"steps is {steps!r}; allowed: whole numbers, 1 or more")

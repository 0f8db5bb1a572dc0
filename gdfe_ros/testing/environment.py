# SPDX-License-Identifier: Apache-2.0
"""A scene as an environment of Gymnasium, without ROS: actions are commands; observations are probes and actuators."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from numbers import Integral
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import Env
from gymnasium.spaces import Box, Space
from gymnasium.vector import AsyncVectorEnv
from numpy.typing import ArrayLike, NDArray

from gdfe_ros.actuators import Actuator, Cable, Chamber, Grip
from gdfe_ros.errors import CommandError, GdfeError
from gdfe_ros.scene import Scene, load_scene
from gdfe_ros.simulation import Simulation
from gdfe_ros.solver.state import Snapshot
from gdfe_ros.testing.approach import Approach, is_held, settle
from gdfe_ros.testing.forking import preload
from gdfe_ros.untrusted.real_number import is_number

Observation = Callable[[Simulation], ArrayLike]
Reward = Callable[[Simulation, NDArray[np.float64]], float]
Ending = Callable[[Simulation], bool]

_WALK = 3
"""Largest number of steps of a reset to find a new goal; it limits the wall time of a reset."""
_LONG = 1e9
"""Duration of a step [s] so long that no rate limit restricts a command."""


@dataclass(frozen=True, eq=False)
class Episode:
    """State of an episode, from which `SoftRobotEnv.reset` can start again.

    Attributes:
        state: state of the simulation.
        goal: (3,) goal of the first probe [m], or None.
    """

    state: Snapshot
    goal: NDArray[np.float64] | None


class SoftRobotEnv(Env):
    """Gymnasium environment of a simulation in lockstep: each step applies one action for ``dt``. Made by `make_env`.

    An action contains the commands of all actuators, in the scene's order and in the units of their modes. Values
    outside an actuator's range are clipped. In one step a command changes by at most range * dt / slew_time, and by
    less if the step does not converge with this change. ``info["applied"]`` contains the applied commands.

    Args:
        scene: scene with actuators; its program is not played.
        observation: function of the simulation that returns an array. None: an array of the probes' positions, the
            actuators' commands and efforts, and the goal, if there is one.
        reward: function of the simulation and the clipped action that returns a number. None: minus the distance [m] of
            the first probe from a goal, which each reset draws at random. The goal is the position of the probe after a
            few steps towards a random command. These steps start from the initial state if a seed is given, else from
            the state at the last goal. In these steps, the scene is simulated without dynamics, or with its dynamics if
            it has rigid bodies or no handles.
        terminated: function of the simulation that returns whether the episode has ended; None: never.
        observation_space: space of the observations; None: bounded for the default observation, and for a function
            unbounded, with the shape of the initial observation.
        dt: simulation time of a step [s].
        steps: number of steps after which an episode is truncated.
        slew_time: shortest simulation time in which a command crosses its whole range [s]; 0: at once.
        render_mode: ``rgb_array`` for pictures by `SoftRobotEnv.render`, without a window; None: no pictures.

    Attributes:
        simulation: the simulation, for reading only; `step` advances it.
        goal: (3,) goal of the first probe [m], used by the default reward; None with a reward function.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 20}  # noqa: RUF012  gymnasium's own

    def __init__(
        self,
        scene: Scene,
        *,
        observation: Observation | None = None,
        reward: Reward | None = None,
        terminated: Ending | None = None,
        observation_space: Space | None = None,
        dt: float = 0.05,
        steps: int = 200,
        slew_time: float = 1.0,
        render_mode: str | None = None,
    ) -> None:
        if render_mode not in (None, "rgb_array"):
            raise GdfeError(f"render_mode is {render_mode!r}; allowed: None, 'rgb_array'")
        self._names = _require_ranges(scene)
        _require_numbers(dt=dt, steps=steps, slew_time=slew_time)
        if (observation is None or reward is None) and not scene.probes:
            raise GdfeError(
                f"scene {scene.name!r} has no probes, which the default observation and reward need; "
                "add the key 'probes', or give observation and reward"
            )
        self.simulation = Simulation(scene)
        self.goal: NDArray[np.float64] | None = None
        self._observe, self._reward, self._ends = observation or self._read_default, reward, terminated
        self._dt, self._most, self._count = dt, steps, 0
        ranges = [(actuator.low, actuator.high) for actuator in scene.actuators]
        self._low, self._high = np.array(ranges, dtype=np.float64).T
        self._reach = (self._high - self._low) * (dt / slew_time if slew_time else np.inf)
        self._approach = Approach(self.simulation, self._reach)
        self._walker: Simulation | None = None
        if reward is None:
            # Goals are found without dynamics, and thus without oscillations, where the scene has equilibria so.
            self._walker = Simulation(replace(scene, dynamics=None) if is_held(scene) else scene)
            self.goal = np.zeros(3)
        self.render_mode, self._painter = render_mode, None
        settle(self.simulation)
        self._beginning = self.simulation.snapshot()
        self.action_space = Box(self._low, self._high, dtype=np.float64)
        if observation is None:
            self._usual = default_space(scene, goal=reward is None)
            self.observation_space = observation_space or self._usual
        else:
            self.observation_space = observation_space or Box(-np.inf, np.inf, self._observation().shape, np.float64)

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[NDArray[np.float64], dict[str, Any]]:
        """Start an episode from the equilibrium of the initial commands (`settle`), or from a stored state.

        Args:
            seed: seed of the random goals; None: continue the sequence of the last seed.
            options: ``goal``, (3,) [m], replaces the random goal. ``episode``, a value of `snapshot`, replaces the
                initial state and the goal, without a solve.

        Raises:
            GdfeError: an option is unknown, or its value is not allowed.
        """
        chosen = dict(options or {})
        episode, goal = chosen.pop("episode", None), chosen.pop("goal", None)
        if chosen:
            raise GdfeError(f"options of reset are {', '.join(map(repr, chosen))}; allowed: 'episode', 'goal'")
        goal = None if goal is None else _goal(goal)
        if episode is not None and not isinstance(episode, Episode):
            raise GdfeError(f"the option 'episode' of reset is {episode!r}; allowed: a value of env.snapshot()")
        super().reset(seed=seed)
        self._count = 0
        if seed is not None and self._walker is not None:
            self._walker.reset()
        if episode is None:
            self.simulation.restore(self._beginning)
        else:
            self.simulation.restore(episode.state)
            self.goal = episode.goal
        if self._walker is not None and (goal is not None or episode is None):
            self.goal = self._draw() if goal is None else goal
        return self._observation(), {"time": self.simulation.time}

    def snapshot(self) -> Episode:
        """Return the present state and goal, from which ``reset(options={"episode": ...})`` can start a new episode.

        Any environment of the same scene accepts the value. The new episode counts its steps from 0.
        """
        return Episode(self.simulation.snapshot(), self.goal)

    def step(self, action: ArrayLike) -> tuple[NDArray[np.float64], float, bool, bool, dict[str, Any]]:
        """Apply an action for ``dt``; return observation, reward, terminated, truncated and info.

        The episode is truncated after a step that did not converge, and after its last step. ``info["why"]`` then
        contains the reason.

        Raises:
            CommandError: the action has the wrong shape, or a value is not finite; the state is unchanged.
        """
        given = np.asarray(action, dtype=np.float64)
        if given.shape != self._low.shape or not np.isfinite(given).all():
            raise CommandError(f"the action is {action!r}; allowed: {len(self._low)} finite numbers, {self._names}")
        given = np.clip(given, self._low, self._high)
        result = self._approach.step(given, self._dt)
        self._count += 1
        info = {"time": result.time, "converged": result.converged, "iterations": result.iterations}
        info["applied"] = self._approach.applied
        truncated = not result.converged or self._count >= self._most
        if truncated:
            info["why"] = f"not converged: {result.message}" if not result.converged else f"{self._most} steps are over"
        ended = self._ends is not None and bool(self._ends(self.simulation))
        return self._observation(), self._evaluate_reward(given), ended, truncated, info

    def render(self) -> NDArray[np.uint8] | None:
        """Return a picture (480, 640, 3) of the present state if the render mode is ``rgb_array``, else None.

        Raises:
            GdfeError: pyvista is not installed.
        """
        if self.render_mode is None:
            return None
        if self._painter is None:
            from gdfe_ros.testing.render import Painter  # VTK, for pictures only

            self._painter = Painter(self.simulation)
        return self._painter.picture()

    def close(self) -> None:
        """Release the memory of pictures."""
        if self._painter is not None:
            self._painter.close()
            self._painter = None

    def _observation(self) -> NDArray[np.float64]:
        return np.asarray(self._observe(self.simulation), dtype=np.float64)

    def _read_default(self, simulation: Simulation) -> NDArray[np.float64]:
        """Return the default observation: probe positions [m], actuator commands, efforts [N] or [Pa], and goal [m].

        Numbers beyond the bounds of `default_space` are at the bounds.
        """
        states = simulation.actuator_states().values()
        parts = [*simulation.probe_positions().values(), [state.command for state in states]]
        parts += [[state.effort for state in states], [] if self.goal is None else self.goal]
        found = np.concatenate([np.asarray(part, dtype=np.float64) for part in parts])
        return np.clip(found, self._usual.low, self._usual.high)

    def _evaluate_reward(self, action: NDArray[np.float64]) -> float:
        if self._reward is not None:
            return float(self._reward(self.simulation, action))
        return -float(np.linalg.norm(_tip(self.simulation) - self.goal))

    def _draw(self) -> NDArray[np.float64]:
        """Return a reachable goal (3,) [m]: the first probe's position after some steps towards a random command.

        The first step starts from the state at the last goal. The last step is step number ``_WALK``, or the last one
        before a step that does not converge.
        """
        approach = Approach(self._walker, self._reach)
        start, wanted = approach.applied, self.np_random.uniform(self._low, self._high)
        steps = max(1.0, np.ceil(np.max(np.abs(wanted - start) / np.maximum(self._reach, np.finfo(float).tiny))))
        dt = self._dt if self._walker.scene.dynamics else _LONG
        for count in range(1, int(min(steps, _WALK)) + 1):
            before = self._walker.snapshot()
            if not approach.step(start + count / steps * (wanted - start), dt, whole=True).converged:
                self._walker.restore(before)
                break
        return _tip(self._walker)


def make_env(scene: str | Path | Scene, *, overrides: Mapping[str, Any] | None = None, **options: Any) -> SoftRobotEnv:
    """Make an environment of Gymnasium from a scene.

    Args:
        scene: name, path, or loaded scene.
        overrides: dict from dotted key to the value that replaces the scene's. The scene's program is not played.
        options: ``observation``, ``reward``, ``terminated``, ``observation_space``, ``dt``, ``steps``, ``slew_time``
            and ``render_mode`` of `SoftRobotEnv`.

    Raises:
        GdfeError: the scene has no actuators, an actuator has no range, probes are needed and missing, or an option is
            out of range.

    Example:
        >>> env = make_env("tendon_finger")
        >>> seen, _ = env.reset(seed=0)
        >>> seen, reward, terminated, truncated, info = env.step(env.action_space.sample())
    """
    # Actions replace the program, whose commands may lie outside of a range that the overrides have narrowed.
    loaded = scene if isinstance(scene, Scene) else load_scene(scene, overrides={**(overrides or {}), "program": None})
    return SoftRobotEnv(loaded, **options)


def _tip(simulation: Simulation) -> NDArray[np.float64]:
    """Return the position of the first probe, (3,) [m]."""
    return next(iter(simulation.probe_positions().values()))


def _goal(given: ArrayLike) -> NDArray[np.float64]:
    goal = np.array(given, dtype=np.float64)
    if goal.shape != (3,) or not np.isfinite(goal).all():
        raise GdfeError(f"the goal is {given!r}; allowed: three finite numbers [m]")
    return goal


def _require_ranges(scene: Scene) -> list[str]:
    """Return the names of the actuators; raise ``GdfeError`` if there is none, or if one has no range."""
    if not scene.actuators:
        raise GdfeError(f"scene {scene.name!r} has no actuators for actions to command; add the key 'actuators'")
    endless = [item.name for item in scene.actuators if not math.isfinite(item.high - item.low)]
    if endless:
        raise GdfeError(f"actuators {', '.join(endless)} of scene {scene.name!r} have no range; add their key 'range'")
    return [actuator.name for actuator in scene.actuators]


def _require_numbers(*, dt: float, steps: int, slew_time: float) -> None:
    if not (math.isfinite(dt) and dt > 0.0):
        raise GdfeError(f"dt is {dt!r}; allowed: above 0 s")
    if not (math.isfinite(slew_time) and slew_time >= 0.0):
        raise GdfeError(f"slew_time is {slew_time!r}; allowed: 0 s or more")
    if not (is_number(steps, Integral) and steps >= 1):
        raise GdfeError(f"steps is {steps!r}; allowed: whole numbers, 1 or more")


def make_vector_env(scene: str | Path, count: int, *, context: str = "forkserver", **options: Any) -> AsyncVectorEnv:
    """Make environments that run in parallel, each in a process of its own.

    Threads of one process could use the same matrix factors, but they would wait for Python's lock between the compiled
    parts of a step. ``python -m benchmarks.environments`` measures threads and processes. By default the processes are
    forked from a server that has imported the package and loaded the kernels once.

    Args:
        scene: name of a scene, or path of a scene file.
        count: number of environments.
        context: start method of the processes. With ``spawn`` each process imports the package. ``fork`` does not work,
            because it copies the threads of the compiler in an invalid state.
        options: keyword arguments of `make_env`.
    """
    if context == "forkserver":
        preload()
    return AsyncVectorEnv([partial(make_env, scene, **options)] * count, context=context)


NEAR, FAR = 2.0, 10.0
"""Largest distance of a probe from the undeformed body's bounding box, divided by the body's extent: NEAR if handles
hold the body, FAR if not.
"""
FASTEST = 1e3
"""Largest assumed acceleration [m/s^2], gravity included, of a rigid body that a grip holds."""
PRESSURE = 10.0
"""Largest pressure in a chamber with a commanded volume, divided by the stiffest material's initial modulus."""


def default_space(scene: Scene, *, goal: bool) -> Box:
    """Return the space of probe positions [m], commands, efforts [N] or [Pa] and, if there is one, the goal [m].

    Positions lie within `NEAR` or `FAR` extents of the undeformed body. Commands lie within the actuators' ranges, and
    commanded efforts within the range that is extended to 0. Other tensions of cables and forces of grips are below the
    stiffest material's initial modulus times the squared extent of the body; for grips, `FASTEST` times the mass of the
    rigid bodies is added. Other pressures are below `PRESSURE` times this modulus.
    """
    mesh = scene.mesh
    reach = (NEAR if is_held(scene) else FAR) * mesh.extent
    low, high = mesh.bounds[0] - reach, mesh.bounds[1] + reach
    efforts = [_efforts(scene, actuator) for actuator in scene.actuators]
    places = len(scene.probes)
    lows = [*[low] * places, [item.low for item in scene.actuators], [least for least, _ in efforts]]
    highs = [*[high] * places, [item.high for item in scene.actuators], [most for _, most in efforts]]
    if goal:
        lows, highs = [*lows, low], [*highs, high]
    return Box(np.concatenate(lows), np.concatenate(highs), dtype=np.float64)


def _efforts(scene: Scene, actuator: Actuator) -> tuple[float, float]:
    """Return the least and the largest effort of an actuator in an observation."""
    if actuator.mode.by_effort:
        return min(actuator.low, 0.0), max(actuator.high, 0.0)
    stiffest = max(material.young0 for material in scene.materials.values())
    if isinstance(actuator, Cable):
        return 0.0, stiffest * scene.mesh.extent**2
    if isinstance(actuator, Grip):
        carried = sum(body.mass for body in scene.rigid_bodies)
        return 0.0, stiffest * scene.mesh.extent**2 + FASTEST * carried
    most = PRESSURE * stiffest if isinstance(actuator, Chamber) else 1.0
    return -most, most

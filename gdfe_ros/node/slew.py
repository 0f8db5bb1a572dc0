# SPDX-License-Identifier: Apache-2.0
"""Rate limit of actuator commands, adapted to the convergence of the steps."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from enum import Enum, auto

from gdfe_ros.actuators import Actuator, Mode
from gdfe_ros.simulation import Command

_SLOWEST = 1.0 / 32.0
"""Smallest fraction of the full rate."""
_SLOWER, _FASTER = 0.5, 1.2
"""Factors on the fraction of the full rate: after a step that a deadline ended, and after any other step."""
_HELD, _BACK = 200, 2000
"""Largest numbers of iterations with a constant command, and after a return to the last converged command. A change
that converges needs 5 to 150 iterations.
"""
_LEAST = 4
"""Number of iterations that a step with fewer iterations counts as: near instability, other work takes more time."""


class _Phase(Enum):
    """Treatment of pending commands in the next step.

    GO: they change at the limited rate. HOLD: they stay constant. BACK: they go back to the last converged values.
    FREE: only ``slew_time`` limits them. STOP: they stay constant until another goal is given.
    """

    GO = auto()
    HOLD = auto()
    BACK = auto()
    FREE = auto()
    STOP = auto()


class Slew:
    """Limits the rate of actuator commands to a fraction of the full rate, which is range / slew_time.

    In a step an actuator's command changes by at most ``share`` * range / slew_time * dt. Initially ``share`` is 1. If
    a deadline ends a step before it converges, ``share`` is halved, and the command stays constant until a later step,
    which continues the solve, has converged. Each step that converges increases ``share`` by a fifth, up to 1. Only a
    step that a deadline ended counts as a step that did not converge.

    If the steps with the constant command do not converge within 200 iterations, the command goes back to its last
    converged value, and the next change is half as large. If a change with the smallest ``share``, 1/32, fails in the
    same manner, each following change is twice as large, to pass a limit of stability. If even a change to the goal
    fails, the command stays at its last converged value until another goal is given. If the steps back do not converge
    within 2000 iterations either, the command is not the cause. Then only ``slew_time`` limits it.

    Step records contain the limited commands, so that replays do not depend on this limit.

    Args:
        actuators: actuators of the scene; commands of grips, and of actuators without a finite range, are not limited.
    """

    def __init__(self, actuators: Iterable[Actuator]) -> None:
        gradual = (actuator for actuator in actuators if actuator.mode is not Mode.GRIP)
        ranges = {actuator.name: actuator.high - actuator.low for actuator in gradual}
        self._ranges = {name: span for name, span in ranges.items() if math.isfinite(span)}
        self.clear()

    def clear(self) -> None:
        """Drop the goals of all commands, and return to the full rate."""
        self._goals: dict[str, float] = {}
        self._good: dict[str, float] = {}
        self._given: dict[str, float] = {}
        self._phase, self._share, self._effort = _Phase.GO, 1.0, 0
        self._leaping = self._missed = False

    @property
    def moving(self) -> bool:
        """Whether a command still changes towards its goal."""
        return bool(self._goals) and not self.stopped

    @property
    def stopped(self) -> bool:
        """Whether commands stay short of their goals because no further step converged within its deadline."""
        return self._phase is _Phase.STOP

    @property
    def goals(self) -> Mapping[str, float]:
        """Dict from actuator name to goal, for commands that have not reached their goals."""
        return dict(self._goals)

    @property
    def share(self) -> float:
        """Present fraction of the full rate."""
        return self._share

    def limit(self, command: Command, present: Mapping[str, float], *, dt: float, slew_time: float) -> Command:
        """Return the limited command of a step.

        Args:
            command: command of this step.
            present: present commands, by name.
            dt: duration of the change [s].
            slew_time: time in which an actuator's command crosses its range [s]; 0: any change is made at once.
        """
        if not self._goals and not command.actuators:
            self._given = {}
            return command
        limited = self._ranges.keys() if slew_time > 0.0 else ()
        wanted = {**self._goals, **command.actuators}
        goals = {name: goal for name, goal in wanted.items() if name in limited}
        if not self._goals:
            self._good = {}
        self._good = {name: self._good.get(name, present[name]) for name in goals}
        if self.stopped and goals != self._goals:
            self._phase, self._share, self._leaping = _Phase.GO, _SLOWEST, False
        self._goals, self._given = goals, {}
        for name, goal in goals.items() if not self.stopped else ():
            reach = self._share * self._ranges[name] * dt / slew_time
            self._given[name] = self._next(name, goal, present[name], reach)
        unlimited = {name: value for name, value in wanted.items() if name not in goals}
        return replace(command, actuators={**unlimited, **self._given})

    def _next(self, name: str, goal: float, present: float, reach: float) -> float:
        """Return an actuator's command in the next step; towards the goal it changes by at most ``reach``."""
        if self._phase is _Phase.HOLD:
            return present
        if self._phase is _Phase.BACK:
            return self._good[name]
        change = goal - present
        return goal if abs(change) <= reach * (1.0 + 1e-9) else present + math.copysign(reach, change)

    def note(self, *, converged: bool, cut: bool, iterations: int) -> None:
        """Record the outcome of a step: whether it converged, whether a deadline ended it, and its iterations."""
        if not self._given:
            return
        self._effort = self._effort + max(_LEAST, iterations) if cut and not converged else 0
        if converged and self._phase is _Phase.BACK:
            self._try_again()
        elif converged or not cut:
            self._good |= self._given
            self._goals = {name: goal for name, goal in self._goals.items() if self._given[name] != goal}
            self._phase, self._leaping = _Phase.GO, False
            self._share = min(1.0, _FASTER * self._share)
        elif self._phase is _Phase.GO:
            self._phase, self._leaping = _Phase.HOLD, self._leaping or self._share < 1.01 * _SLOWEST
            self._share = self._share if self._leaping else max(_SLOWEST, _SLOWER * self._share)
        elif self._phase is _Phase.HOLD and self._effort >= _HELD:
            self._phase, self._effort, self._missed = _Phase.BACK, 0, self._given == self._goals
        elif self._phase is _Phase.BACK and self._effort >= _BACK:
            self._phase, self._share, self._leaping = _Phase.FREE, 1.0, False

    def _try_again(self) -> None:
        """Choose the change after a return to the last converged command: smaller, larger to pass a limit, or none."""
        self._phase = _Phase.STOP if self._leaping and self._missed else _Phase.GO
        self._share *= 2.0 if self._leaping else 1.0

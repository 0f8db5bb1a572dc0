# SPDX-License-Identifier: Apache-2.0
"""Commands of actuators that are followed at a rate that steps keep up with."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace

from gdfe_ros.actuators import Actuator
from gdfe_ros.simulation import Command

_SLOWEST = 1.0 / 64.0
"""Smallest share of the full rate."""
_SLOWER, _FASTER = 0.5, 1.2
"""By what the share changes after a step that did not converge, and after one that did."""
_PATIENCE = 3
"""Failures in a row from which on a command goes back."""
_IMPATIENCE = 8
"""Failures in a row from which on it goes on all the same."""


class Slew:
    """Limits how fast commands of actuators change, by default to their range in ``slew_time``.

    In a step an actuator's command changes by at most share * range / slew_time * dt. The share is 1 until a step does
    not converge before its deadline. Then the share is halved and the command stays, for the next step goes on from
    there; with the third failure in a row it goes half of the way back to the command of the last step that converged.
    With the eighth it goes on, faster each time: small steps lead to the edge of a body's stability, not past it. The
    share grows again by a fifth with each step that converges. Steps record the commands that they were given, so
    replays need none of this.

    Args:
        actuators: of the scene; those without a finite range are not limited.
    """

    def __init__(self, actuators: Iterable[Actuator]) -> None:
        ranges = {actuator.name: actuator.high - actuator.low for actuator in actuators}
        self._ranges = {name: span for name, span in ranges.items() if math.isfinite(span)}
        self.clear()

    def clear(self) -> None:
        """Forget where commands are to go, and how fast."""
        self._goals: dict[str, float] = {}
        self._good: dict[str, float] = {}
        self._given: dict[str, float] = {}
        self._share, self._failures = 1.0, 0

    @property
    def moving(self) -> bool:
        """Whether commands are still on their way."""
        return bool(self._goals)

    @property
    def goals(self) -> Mapping[str, float]:
        """Where commands that are on their way go, by actuator."""
        return dict(self._goals)

    @property
    def share(self) -> float:
        """Of the full rate."""
        return self._share

    def limit(self, command: Command, present: Mapping[str, float], *, dt: float, slew_time: float) -> Command:
        """Give what a step consumes of a command and of those on their way.

        Args:
            command: of this step.
            present: commands in force, by name.
            dt: time in which they change [s].
            slew_time: in which an actuator crosses its range [s]; 0: any change is made at once.
        """
        wanted = {**self._goals, **command.actuators}
        if not wanted:
            self._given = {}
            return command
        values, goals = dict(wanted), {}
        self._good = {name: self._good.get(name, present[name]) for name in wanted}
        for name, goal in wanted.items():
            if slew_time <= 0.0 or name not in self._ranges:
                continue
            reach = self._share * self._ranges[name] * dt / slew_time
            if 0 < self._failures < _IMPATIENCE:
                back = 0.5 if self._failures >= _PATIENCE else 0.0
                values[name] = present[name] + back * (self._good[name] - present[name])
            elif abs(goal - present[name]) > reach * (1.0 + 1e-9):
                values[name] = present[name] + math.copysign(reach, goal - present[name])
            if values[name] != goal:
                goals[name] = goal
        self._given, self._goals = values, goals
        return replace(command, actuators=values)

    def note(self, *, converged: bool, cut: bool) -> None:
        """Learn from a step: whether it converged, and whether a deadline ended it before it could."""
        if converged:
            self._good |= self._given
            self._share, self._failures = min(1.0, _FASTER * self._share), 0
        elif self._given and cut:
            self._failures += 1
            if self._failures == 1:
                self._share = max(_SLOWEST, _SLOWER * self._share)
            elif self._failures > _IMPATIENCE:
                self._share = min(1.0, self._share / _SLOWER)

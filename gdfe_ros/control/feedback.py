# SPDX-License-Identifier: Apache-2.0
"""Closed loop: commands from what was measured on the robot, with a model that may be wrong.

A command is the one under which the robot was measured, plus the change that makes up for the distance to the goal by
the Jacobian J. J is the model's at the start. Each measurement corrects it (Broyden 1965): a change dc that moved the
robot by dy instead of J dc adds

    dJ = learning * (dy - J dc) (D^2 dc)^T / |D dc|^2,

with the costs D of the changes (`CommandLimits.costs`). The error itself adds up in the command, so that an error of
the model leaves no offset; at the end of a range nothing adds up.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gdfe_ros.control.inverse import ENOUGH, LONGER, SHORTER, Reach, require_equilibria, require_positive
from gdfe_ros.control.limits import CommandLimits
from gdfe_ros.control.programme import least_squares
from gdfe_ros.control.stack import Stack
from gdfe_ros.control.targets import Aim
from gdfe_ros.errors import CommandError
from gdfe_ros.simulation import Simulation

Array = NDArray[np.float64]
DAMPING = 1e-3
"""Weight of a change of the commands, over what the strongest actuator of its unit moves by it. Where the Jacobian is
nearly singular, commands change by at most 500 times what the strongest actuator would need."""
BASELINE = 3.0
"""Motion over the tolerance from which on a measurement corrects the Jacobian: noise is then a third of it at most."""
WITHIN = 0.5
"""Share of the distance that a change makes up for from which on its goal counts as within reach."""


class FeedbackControl:
    """Moves a robot such that its probes go where they are told, by measurements of the probes.

    Tell each measurement by `observe`, then ask for the next command by `command`. The robot must have followed a
    command when it is measured; one that still swings teaches the Jacobian wrongly (``learning=0`` keeps the model's).

    Args:
        simulation: the model, at the commands at which the robot is; it is not stepped.
        targets: what is to be where; names alone take all axes.
        actuators: names; None takes all.
        tolerance: distance [m] at which a goal counts as reached, at least the noise of the measurements; motions below
            three times of it correct nothing.
        slew: least time [s] in which a command crosses its range; not below that of the robot, which would else follow
            one actuator more than the other (a node's ``slew_time``).
        learning: share of what a change did otherwise than foretold that corrects the Jacobian, from 0 to 1.

    Raises:
        CommandError: no such probe or actuator, dynamics, or a number outside of its range.
        GdfeError: the model's state has no derivative.

    Example:
        >>> control = FeedbackControl(model, [Target(probe="tip", axes=(0, 2))])
        >>> control.observe([measured])
        >>> control.command([goal], dt=0.02).commands
        {'flexor': 4.9, 'extensor': 15.2}
    """

    def __init__(
        self,
        simulation: Simulation,
        targets: Sequence[Aim | str],
        *,
        actuators: Sequence[str] | None = None,
        tolerance: float = 1e-5,
        learning: float = 0.6,
        slew: float = 0.0,
    ) -> None:
        require_equilibria(simulation.scene)
        require_positive("the tolerance of feedback control", tolerance, "m")
        if not 0.0 <= learning <= 1.0:
            raise CommandError(f"learning must be from 0 to 1, got {learning!r}")
        if not 0.0 <= slew < np.inf:
            raise CommandError(f"slew must be a finite time [s], not negative, got {slew!r}")
        self._stack = Stack(simulation, targets, tolerance)
        self.names = tuple(simulation.actuator_names if actuators is None else actuators)
        self._limits = CommandLimits.of_scene(simulation.scene, self.names, slew=slew)
        if not simulation.settled:
            simulation.step()
        self._rows, self._learning = self._stack.jacobian(self.names), learning
        self._costs = np.maximum(self._limits.costs(self._rows), 1e-300)
        states = simulation.actuator_states()
        self._sent = np.array([states[name].command for name in self.names])
        self._known = self._base = self._sent, self._stack.values()
        self._trust, self._goals = 1.0, self._known[1]

    @property
    def targets(self) -> tuple[Aim, ...]:
        """The targets (t,)."""
        return self._stack.targets

    @property
    def sent(self) -> dict[str, float]:
        """The last commands that were returned, by actuator."""
        return dict(zip(self.names, self._sent.tolist(), strict=True))

    def time_to(self, wanted: Mapping[str, float], now: Mapping[str, float]) -> float:
        """Return the least time [s] in which rates let commands go from ``now`` to ``wanted``."""
        return self._limits.time(np.array([wanted[name] - now[name] for name in self.names]))

    def observe(self, values: ArrayLike, commands: Mapping[str, float] | None = None) -> None:
        """Tell what was measured.

        Args:
            values: (t, 3) of the targets, in the unit of each: m, rad, N.
            commands: in force at that time, by actuator; None: those that were returned last.

        Raises:
            CommandError: the shape is another, a value is not finite, or a command is missing.
        """
        measured, given = self._stack.checked(values, "measured values"), self._sent
        if commands is not None:
            missing = [name for name in self.names if not np.isfinite(commands.get(name, np.nan))]
            if missing:
                raise CommandError(f"no finite command in force of {', '.join(missing)}; give one of each actuator")
            given = np.array([commands[name] for name in self.names])
        self._known = given, measured
        change, moved = given - self._base[0], self._stack.errors(measured, self._base[1])
        foretold, scaled = self._rows @ change, self._costs * change
        self._judge(measured, foretold)
        if max(np.linalg.norm(moved), np.linalg.norm(foretold)) < BASELINE or not change.any():
            return  # within the noise: later measurements tell more of the same change
        by_change = self._costs * scaled / float(scaled @ scaled)
        self._rows = self._rows + self._learning * np.outer(moved - foretold, by_change)
        self._base = self._known

    def command(self, goals: ArrayLike, dt: float) -> Reach:
        """Return the commands of the next ``dt`` [s], towards goals (t, 3) at its end, within ranges and rates.

        The answer's distances are those of the last measurement. Its message says which goals the commands are not
        foretold to reach, and why.

        Raises:
            CommandError: goals or time are not allowed; nothing has changed.
        """
        wanted, stack = self._stack.checked(goals), self._stack
        require_positive("the time of a command", dt, "s")
        self._goals, (commands, values) = wanted, self._known
        error, way = stack.errors(wanted, values), stack.length(wanted, values)
        low, high = self._limits.room(self._sent, dt)
        behind = self._sent - commands
        share = min(1.0, self._trust / max(way, 1e-300))
        given = {"least": DAMPING, "costs": self._limits.costs(self._rows)}
        change = least_squares(self._rows, share * error, low + behind, high + behind, **given)
        self._sent = np.clip(self._limits.changed(commands, change), self._sent + low, self._sent + high)
        left = error - self._rows @ (self._sent - commands)
        return Reach(
            commands=self.sent,
            distances=stack.distances(error),
            reached=stack.reached(error),
            message=stack.message(left, values, self._limits.ended(self._sent)),
            tries=1,
        )

    def _judge(self, measured: Array, foretold: Array) -> None:
        """Shorten the longest change where the last one led nearer by less than a quarter of what was foretold (m,).

        That is asked only where most of the distance was to be left: near the nearest point to a goal out of reach,
        where long changes would go round it. Within reach, errors of the Jacobian are left to learning.
        """
        before, stack = self._base[1], self._stack
        error, after = stack.errors(self._goals, before), stack.errors(self._goals, measured)
        length = np.linalg.norm(error)
        gain = length - np.linalg.norm(error - foretold)
        if not BASELINE < gain < WITHIN * length or length - np.linalg.norm(after) > ENOUGH * gain:
            self._trust = min(1.0, LONGER * self._trust)
        else:
            self._trust = SHORTER * min(self._trust, stack.length(self._goals, before))

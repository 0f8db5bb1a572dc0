# SPDX-License-Identifier: Apache-2.0
"""Closed-loop control: commands from measurements of the robot, with a model that may be inaccurate.

Each command is the command at the last measurement plus a change. With J, the Jacobian of the targets with respect to
the commands, the predicted motion is J times the change; the change is chosen so that this motion reaches the goal. J
is initially the model's. Each measurement corrects it (Broyden 1965): if a change dc moved the robot by dy instead of
J dc, J changes by

    dJ = learning * (dy - J dc) (D^2 dc)^T / |D dc|^2,

where D are the costs of the changes (`CommandLimits.costs`). The command integrates the error over time, so that an
error of the model causes no lasting offset. At the end of a command's range, the integration stops.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gdfe_ros.control.inverse import ENOUGH, LONGER, SHORTER, Reach, require_equilibria, require_positive
from gdfe_ros.control.limits import CommandLimits, least_squares
from gdfe_ros.control.stack import Stack
from gdfe_ros.control.targets import Aim
from gdfe_ros.errors import CommandError
from gdfe_ros.simulation import Simulation

Array = NDArray[np.float64]
DAMPING = 1e-3
"""Weight of the cost |D dc| of a change dc. If the Jacobian is nearly singular, the weight limits changes to 500 times
the change that the strongest actuator would need.
"""
BASELINE = 3.0
"""Least measured or predicted motion, in tolerances, at which a measurement corrects the Jacobian. Noise is then at
most a third of the motion.
"""
WITHIN = 0.5
"""A goal counts as within reach if a change is predicted to remove more than this fraction of the distance to it."""


class FeedbackControl:
    """Closed-loop controller: it computes commands from measurements so that the targets reach their goals.

    Pass each measurement to `observe`, then get the next command from `command`. Measure the robot after it has
    followed a command: while it still oscillates, a measurement corrupts the Jacobian. With ``learning=0`` the Jacobian
    remains that of the model.

    Args:
        simulation: model with the robot's present commands; it is stepped once if it is not at an equilibrium.
        targets: targets to control; a probe's name means its position along all axes.
        actuators: names of the actuators; None: all.
        tolerance: distance [m] at which a goal counts as reached; it must be at least the noise of the measurements.
            Motions below three times this distance do not correct the Jacobian.
        slew: least time [s] in which a command may cross its range. It must be at least that of the robot (a node's
            ``slew_time``); otherwise the robot lags behind the commands of some actuators more than of others.
        learning: fraction, from 0 to 1, of the prediction error of a change by which the Jacobian is corrected.

    Raises:
        CommandError: there is no such probe or actuator, the scene has dynamics, or a number is outside its range.
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
        self._limits = CommandLimits(simulation.scene, self.names, slew=slew)
        if simulation.result is None or not simulation.settled:
            simulation.step()
        self._rows, self._learning = self._stack.jacobian(self.names), learning
        self._costs = np.maximum(self._limits.costs(self._rows), 1e-300)
        states = simulation.actuator_states()
        self._sent = np.array([states[name].command for name in self.names])
        self._known = self._base = self._sent, self._stack.values()
        self._trust, self._goals = 1.0, self._known[1]

    @property
    def targets(self) -> tuple[Aim, ...]:
        """Controlled targets (t,)."""
        return self._stack.targets

    @property
    def sent(self) -> dict[str, float]:
        """Dict from actuator to the last command that was returned."""
        return dict(zip(self.names, self._sent.tolist(), strict=True))

    def time_to(self, wanted: Mapping[str, float], now: Mapping[str, float]) -> float:
        """Return the least time [s] in which commands can change from ``now`` to ``wanted`` within their rates."""
        return self._limits.time(np.array([wanted[name] - now[name] for name in self.names]))

    def observe(self, values: ArrayLike, commands: Mapping[str, float] | None = None) -> None:
        """Store a measurement, and correct the Jacobian with it.

        Args:
            values: measured values of the targets (t, 3), in the unit of each target: m, rad or N.
            commands: dict from actuator to the command in force at the measurement; None: the last returned commands.

        Raises:
            CommandError: the shape is wrong, a value is not finite, or a command is missing or outside of its range;
                nothing has changed.
        """
        measured, given = self._stack.check_goals(values, "measured values"), self._sent
        if commands is not None:
            missing = [name for name in self.names if not np.isfinite(commands.get(name, np.nan))]
            if missing:
                raise CommandError(f"no finite command in force of {', '.join(missing)}; give one of each actuator")
            given = self._limits.require(commands)
        self._known = given, measured
        change, moved = given - self._base[0], self._stack.errors(measured, self._base[1])
        foretold, scaled = self._rows @ change, self._costs * change
        self._judge(measured, foretold)
        if max(np.linalg.norm(moved), np.linalg.norm(foretold)) < BASELINE or not change.any():
            return  # The motion may be noise. A later measurement corrects the Jacobian with the sum of the changes.
        by_change = self._costs * scaled / float(scaled @ scaled)
        self._rows = self._rows + self._learning * np.outer(moved - foretold, by_change)
        self._base = self._known

    def command(self, goals: ArrayLike, dt: float) -> Reach:
        """Return the commands that approach goals (t, 3) within the next ``dt`` [s], limited by ranges and rates.

        The returned distances are those of the last measurement. Until all goals are reached, the message names the
        goals that are probably not reached with these commands either, and the reason.

        Raises:
            CommandError: goals or time are not allowed; nothing has changed.
        """
        wanted, stack = self._stack.check_goals(goals), self._stack
        require_positive("the time of a command", dt, "s")
        self._goals, (commands, values) = wanted, self._known
        error, distance = stack.errors(wanted, values), stack.length(wanted, values)
        low, high = self._limits.room(self._sent, dt)
        behind = self._sent - commands
        fraction = min(1.0, self._trust / max(distance, 1e-300))
        given = {"least": DAMPING, "costs": self._limits.costs(self._rows)}
        change = least_squares(self._rows, fraction * error, low + behind, high + behind, **given)
        self._sent = np.clip(self._limits.apply_change(commands, change), self._sent + low, self._sent + high)
        left, reached = error - self._rows @ (self._sent - commands), stack.has_reached(error)
        return Reach(
            commands=self.sent,
            distances=stack.distances(error),
            reached=reached,
            message="" if reached else stack.message(left, values, self._limits.list_limited(self._sent)),
        )

    def _judge(self, measured: Array, foretold: Array) -> None:
        """Adapt the largest allowed change to the effect of the last change; ``foretold`` (m,) is the predicted motion.

        The limit is reduced if the error fell by less than `ENOUGH` times the prediction, and if the prediction was
        that most of the distance to the goal remains: the goal is then out of reach. With constant limits, commands
        would circle around the point closest to such a goal. In all other cases the limit is raised: `observe` corrects
        the Jacobian.
        """
        before, stack = self._base[1], self._stack
        error, after = stack.errors(self._goals, before), stack.errors(self._goals, measured)
        length = np.linalg.norm(error)
        gain = length - np.linalg.norm(error - foretold)
        if not BASELINE < gain < WITHIN * length or length - np.linalg.norm(after) > ENOUGH * gain:
            self._trust = min(1.0, LONGER * self._trust)
        else:
            self._trust = SHORTER * min(self._trust, stack.length(self._goals, before))

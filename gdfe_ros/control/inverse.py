# SPDX-License-Identifier: Apache-2.0
"""Commands that bring the model's targets to their goals, by the Gauss-Newton method with bounds.

Each change of the commands is the solution of a quadratic programme,

    min  sum_i w_i |J_i dc - e_i|^2 + l^2 |D dc|^2    with  low <= c + dc <= high,  |dc| <= rate dt,

where, for target i, J_i is the exact Jacobian with respect to the commands (docs/sensitivities.md), e_i the distance
from the goal, and w_i the priority. D are the costs of the changes (`CommandLimits.costs`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gdfe_ros.actuators import Mode
from gdfe_ros.control.limits import CommandLimits, least_squares
from gdfe_ros.control.stack import Stack
from gdfe_ros.control.targets import Aim
from gdfe_ros.errors import CommandError, GdfeError
from gdfe_ros.scene.scene import Scene
from gdfe_ros.simulation import Command, Simulation

Array = NDArray[np.float64]
LEAST = 1e-4
"""Weight l of the cost |D dc| of a change dc of the commands."""
SHORTER, LONGER = 0.25, 2.0
"""Factors on the largest allowed change, after a change that did not reduce the errors enough, and after one that did.
"""
MOST_TRIES = 60
"""Largest number of changes of the commands; goals that are not reached by then count as out of reach."""
ENOUGH = 0.25
"""Least actual reduction of the errors, divided by the predicted reduction, at which a change is accepted."""
STANDSTILL, FAINT = 0.1, 1e-3
"""Least predicted motion of the targets, and least predicted reduction of their errors, in tolerances, at which a
change is tried.
"""


@dataclass(frozen=True, eq=False, kw_only=True)
class Reach:
    """Result of inverse control: commands, and the remaining distances of the targets from their goals.

    Attributes:
        commands: dict from actuator to command.
        distances: distance of each target from its goal (t,), along the target's axes, in its unit: m, rad or N.
        reached: whether all targets are within their tolerances.
        message: reason why goals were not reached; empty if all were reached.
    """

    commands: Mapping[str, float]
    distances: Array
    reached: bool
    message: str


class InverseControl:
    """Open-loop controller: commands a model's actuators so that the model's targets reach their goals.

    All commands stay within the scene's ranges, and tensions stay non-negative. Each `move` respects the scene's rates.

    Args:
        simulation: the model, without dynamics; each command leads to an equilibrium.
        targets: targets to control; a probe's name means its position along all axes.
        actuators: names of the actuators; None: all except grips.
        tolerance: distance [m] at which a goal counts as reached.

    Raises:
        CommandError: there is no such probe or actuator, the scene has dynamics, or the tolerance is not positive.

    Example:
        >>> control = InverseControl(Simulation(load_scene("tendon_finger")), [Target(probe="tip", axes=(0, 2))])
        >>> control.reach([[0.098, 0.0, -0.013]]).reached
        True
    """

    def __init__(
        self,
        simulation: Simulation,
        targets: Sequence[Aim | str],
        *,
        actuators: Sequence[str] | None = None,
        tolerance: float = 1e-5,
    ) -> None:
        scene = simulation.scene
        require_equilibria(scene)
        require_positive("the tolerance of inverse control", tolerance, "m")
        self._stack = Stack(simulation, targets, tolerance)
        usual = [each.name for each in simulation.scene.actuators if each.mode is not Mode.GRIP]
        self.names = tuple(usual if actuators is None else actuators)
        self._limits = CommandLimits(scene, self.names)
        self.simulation, self._trust = simulation, 1.0
        self._jacobian = KeptJacobian(lambda: self._stack.jacobian(self.names))

    @property
    def targets(self) -> tuple[Aim, ...]:
        """Controlled targets (t,)."""
        return self._stack.targets

    def reach(self, goals: ArrayLike) -> Reach:
        """Change the commands, at most `MOST_TRIES` times, until the targets are at or closest to their goals.

        If goals are out of reach, the commands are those of the closest point, and the message is not empty. The search
        also ends, with a message, at a state that has no derivative.

        Args:
            goals: (t, 3), one row for each target in the target's unit.

        Raises:
            CommandError: the shape is wrong, or a value is not finite; the state is unchanged.
            GdfeError: the present state has no derivative, e.g. because it is a saddle; the state is unchanged.
        """
        wanted, tries, stuck, reason = self._stack.check_goals(goals), 0, False, ""
        with self._all_or_nothing():
            error = self._errors(wanted)
            while tries < MOST_TRIES and not stuck and not self._stack.has_reached(error):
                try:
                    moved, error, spent = self._approach(wanted, error)
                    reason = "" if moved else self._tell_idle()
                except GdfeError as flaw:
                    if not tries:
                        raise
                    reason = str(flaw)
                    break
                tries, stuck = tries + spent, not moved
        return self._report(error, reason)

    def move(self, goals: ArrayLike, dt: float) -> Reach:
        """Change the commands once towards the goals, as far as the rates allow in ``dt`` [s]; for control loops.

        Args:
            goals: (t, 3), one row for each target in the target's unit.
            dt: duration of the step [s].

        Raises:
            CommandError: goals or time are not allowed; the state is unchanged.
            GdfeError: the present state has no derivative; the state is unchanged.
        """
        wanted, reason = self._stack.check_goals(goals), ""
        require_positive("the time of a move", dt, "s")
        with self._all_or_nothing():
            error = self._errors(wanted)
            if not self._stack.has_reached(error):
                moved, error, _ = self._approach(wanted, error, dt)
                reason = "" if moved else self._tell_idle()
        return self._report(error, reason)

    @contextmanager
    def _all_or_nothing(self) -> Iterator[None]:
        """Solve for an equilibrium first; restore the initial state if an error occurs inside the ``with`` block."""
        before = self.simulation.snapshot()
        try:
            if self.simulation.result is None or not self.simulation.settled:
                self.simulation.step()
            yield
        except GdfeError:
            self.simulation.restore(before)
            raise

    def _approach(self, wanted: Array, error: Array, dt: float | None = None) -> tuple[bool, Array, int]:
        """Change the commands once; return whether the errors decreased, the new errors (m,), and the number of tries.

        ``error`` (m,) are the present errors relative to the goals ``wanted`` (t, 3). The change takes ``dt`` [s], or
        the time that the rates require if ``dt`` is None.
        """
        stack, now, tries = self._stack, self._now(), 0
        here, values = self.simulation.snapshot(), stack.values()
        rows = self._jacobian.at(now, values)
        length, distance = float(np.linalg.norm(error)), stack.length(wanted, values)
        while tries < MOST_TRIES:
            tries, fraction = tries + 1, min(1.0, self._trust / distance)
            given = {"least": LEAST, "costs": self._limits.costs(rows)}
            change = least_squares(rows, fraction * error, *self._limits.room(now, dt), **given)
            gain = length - float(np.linalg.norm(error - rows @ change))
            worth = np.linalg.norm(rows @ change) >= STANDSTILL and gain >= FAINT
            if worth and self._go(now, change, dt):
                after = self._errors(wanted)
                if length - float(np.linalg.norm(after)) > ENOUGH * gain:
                    self._trust = min(1.0, LONGER * self._trust)
                    self._jacobian.learn(error - after, self._now(), stack.values())
                    return True, after, tries
            if worth:
                self.simulation.restore(here)
            if not self._jacobian.fresh:
                self._jacobian.forget()
                moved, error, spent = self._approach(wanted, error, dt)
                return moved, error, tries + spent
            self._trust = SHORTER * min(self._trust, distance)
            if not worth or self._trust * length < distance:
                break
        self._trust = 1.0
        return False, error, tries

    def _go(self, now: Array, change: Array, dt: float | None) -> bool:
        """Step the model to the commands after a change (n,); return whether it found an equilibrium."""
        commands = dict(zip(self.names, self._limits.apply_change(now, change).tolist(), strict=True))
        time = self._limits.time(change) if dt is None else dt
        return self.simulation.step(Command(actuators=commands), dt=time).converged

    def _errors(self, wanted: Array) -> Array:
        """Return the model's errors (m,) relative to the goals ``wanted`` (t, 3)."""
        return self._stack.errors(wanted, self._stack.values())

    def _now(self) -> Array:
        """Return the commands (n,) in force, which the rates may have limited."""
        states = self.simulation.actuator_states()
        return np.array([states[name].command for name in self.names])

    def _tell_idle(self) -> str:
        """Return a message that lists the actuators that move no target at present; empty if there are none."""
        rows, limits = self._jacobian.at(self._now(), self._stack.values()), self._limits
        with np.errstate(invalid="ignore"):  # zero times an infinite range
            motions = np.nan_to_num(np.linalg.norm(rows, axis=0) * (limits.high - limits.low))
        idle = [name for name, motion in zip(self.names, motions, strict=True) if motion < STANDSTILL]
        return f"zero derivative at their commands: {', '.join(idle)}; remedy: begin at other ones" if idle else ""

    def _report(self, error: Array, reason: str) -> Reach:
        now = self._now()
        message = self._stack.message(error, self._stack.values(), self._limits.list_limited(now))
        return Reach(
            commands=dict(zip(self.names, now.tolist(), strict=True)),
            distances=self._stack.distances(error),
            reached=self._stack.has_reached(error),
            message="; ".join(filter(None, (message, reason))),
        )


def require_equilibria(scene: Scene) -> None:
    """Raise CommandError for a scene with dynamics."""
    if scene.dynamics is not None:
        raise CommandError("inverse control goes from equilibrium to equilibrium; remedy: a scene without dynamics")


def require_positive(what: str, value: float, unit: str) -> None:
    """Raise CommandError for a value that is not a positive, finite number."""
    if not 0.0 < value < np.inf:
        raise CommandError(f"{what} must be positive and finite [{unit}], got {value!r}")


SURPRISE = 0.3
"""Largest error of the predicted motion, divided by the predicted motion, up to which the Jacobian is reused. Above it,
the exact Jacobian is computed again before the next change.
"""


class KeptJacobian:
    """The Jacobian of values with respect to commands, which is reused for several changes of the commands.

    Broyden's update corrects it after each change. The exact Jacobian is computed again in two cases: the motion of a
    change was predicted badly (`SURPRISE`), or commands or values differ from those at the last update.

    Args:
        exact: function that returns the exact Jacobian (m, n) of the present state.

    Attributes:
        fresh: whether the last call of `at` computed the exact Jacobian.
    """

    def __init__(self, exact: Callable[[], Array]) -> None:
        self._exact = exact
        self._rows: Array | None = None
        self.fresh = False

    def forget(self) -> None:
        """Discard the Jacobian, so that the next call of `at` computes the exact one."""
        self._rows = None

    def at(self, commands: Array, values: Array) -> Array:
        """Return the Jacobian (m, n) for the present commands (n,) and values (t, 3)."""
        known = self._rows is not None
        self.fresh = not (known and all(map(np.array_equal, self._place, (commands, values))))
        if self.fresh:
            self._rows, self._place = self._exact(), (commands, values)
            self._scale = np.maximum(np.linalg.norm(self._rows, axis=0), 1e-300)
        return self._rows

    def learn(self, moved: Array, commands: Array, values: Array) -> None:
        """Correct the Jacobian with the motion ``moved`` (m,) of the last change, and store commands and values."""
        change = commands - self._place[0]
        foretold, scaled = self._rows @ change, self._scale * change
        missed, self._place = moved - foretold, (commands, values)
        if not np.linalg.norm(missed) <= SURPRISE * np.linalg.norm(foretold):
            self.forget()
            return
        self._rows = self._rows + np.outer(missed, self._scale * scaled) / max(float(scaled @ scaled), 1e-300)

# SPDX-License-Identifier: Apache-2.0
"""Limits of actuator commands, and the quadratic programme for one change of the commands within them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.actuators import Cable, Mode
from gdfe_ros.errors import CommandError, DependencyError, require_named
from gdfe_ros.scene.scene import Scene
from gdfe_ros.untrusted.real_number import require_command

Array = NDArray[np.float64]
COMMAND_ROUNDING = 1e-9
"""Largest error of a command, divided by its change, that counts as rounding."""
SINGLE = 1e-6
"""Largest part of a command in force by which it may be outside of its range: the rounding of a message in float32."""


class CommandLimits:
    """Ranges and rates of the commands of some actuators.

    Args:
        scene: scene with the actuators.
        names: names of the actuators (n,) whose commands are limited.
        slew: least time [s] in which a command may cross its range; 0 for no such limit.

    Raises:
        CommandError: there is no such actuator, none is named, or one is named twice.

    Attributes:
        low: least commands (n,); zero or more for a tension.
        high: largest commands (n,).
        rates: largest changes of the commands per second (n,).
    """

    def __init__(self, scene: Scene, names: Sequence[str], *, slew: float = 0.0) -> None:
        known = {actuator.name: actuator for actuator in scene.actuators}
        for name in names:
            require_named("actuator", name, known, f" in scene {scene.name!r}")
        if len(set(names)) < len(names):
            raise CommandError(f"actuators named twice: {', '.join(names)}; give each name once")
        if not names:
            raise CommandError(f"inverse control needs an actuator; actuators of {scene.name!r}: {', '.join(known)}")
        self._names, self._actuators = list(names), [known[name] for name in names]
        actuators = self._actuators
        pulls = [isinstance(each, Cable) and each.mode is Mode.TENSION for each in actuators]
        self.low = np.maximum([each.low for each in actuators], np.where(pulls, 0.0, -np.inf))
        self.high = np.array([each.high for each in actuators])
        self.rates = np.array([each.rate for each in actuators])
        if slew > 0.0:
            self.rates = np.minimum(self.rates, (self.high - self.low) / slew)
        units = [each.mode.unit for each in actuators]
        self._alike = np.array([[unit == other for other in units] for unit in units])

    def costs(self, rows: Array) -> Array:
        """Return the costs D (n,) of changes of the commands, from the Jacobian ``rows`` (m, n).

        The cost of a command is the largest norm among the columns of all commands with its unit. A command that moves
        the targets much less than others of its unit is therefore hardly changed.
        """
        return np.where(self._alike, np.linalg.norm(rows, axis=0), 0.0).max(axis=1)

    def room(self, now: Array, dt: float | None) -> tuple[Array, Array]:
        """Return the least and largest change (n,) of commands ``now`` (n,) in ``dt`` [s]; None ignores the rates."""
        reach = np.full(len(now), np.inf) if dt is None else self.rates * dt
        return np.maximum(self.low - now, -reach), np.minimum(self.high - now, reach)

    def require(self, commands: Mapping[str, float]) -> Array:
        """Return the commands in force (n,), without the rounding (`SINGLE`) that is outside of the ranges.

        Raises:
            CommandError: a command is outside of the scene's range.
        """
        remedy, found = "give the command that was sent, in SI units, or extend the key `range` of the scene", []
        for each in self._actuators:
            given = commands[each.name]
            near = min(max(given, each.low), each.high)
            if abs(near - given) > SINGLE * abs(given):
                what = f"command in force: actuator {each.name!r}: {each.mode.value}"
                require_command(what, given, low=each.low, high=each.high, unit=each.mode.unit, remedy=remedy)
            found.append(near)
        return np.array(found)

    def apply_change(self, now: Array, change: Array) -> Array:
        """Return ``now + change`` (n,), clipped to the ranges, and set to an end within `COMMAND_ROUNDING` of it."""
        commands, rounding = now + change, COMMAND_ROUNDING * np.abs(change)
        commands = np.where(np.abs(commands - self.low) <= rounding, self.low, commands)
        commands = np.where(np.abs(commands - self.high) <= rounding, self.high, commands)
        return np.clip(commands, self.low, self.high)

    def time(self, change: Array) -> float:
        """Return the least time [s] in which the commands can change by ``change`` (n,)."""
        limited = np.isfinite(self.rates)
        with np.errstate(divide="ignore", invalid="ignore"):
            times = np.abs(change[limited]) / self.rates[limited]
        return (1.0 + COMMAND_ROUNDING) * float(times.max(initial=0.0))

    def list_limited(self, commands: Array) -> list[str]:
        """Return the names of the actuators whose command in ``commands`` (n,) is at an end of its range."""
        inside = (self.low < commands) & (commands < self.high)
        return [name for name, free in zip(self._names, inside, strict=True) if not free]


AT_BOUND = 1e-12
"""Distance from a bound up to which x is set to the bound, if |b| = 1 and the columns of A have norms of at most 1."""


def least_squares(
    rows: Array, goal: Array, low: Array, high: Array, *, least: float, costs: Array | None = None
) -> Array:
    """Return the x (n,) that minimises |A x - b|^2 + least^2 |D x|^2 with low <= x <= high.

    The minimum is exact up to rounding, but x never violates the bounds.

    Args:
        rows: A (m, n).
        goal: b (m,).
        low: lower bounds of x (n,); minus infinity for no bound.
        high: upper bounds of x (n,), each at least ``low``; infinity for no bound.
        least: weight of x, above zero, so that the solution is unique.
        costs: D (n,), each at least the norm of A's column; None for these norms.

    Raises:
        DependencyError: quadprog is not installed.
    """
    try:
        import quadprog
    except ImportError as error:
        raise DependencyError("inverse control needs quadprog; remedy: pip install gdfe_ros[control]") from error
    lengths = np.linalg.norm(rows, axis=0) if costs is None else costs
    lengths = np.maximum(lengths, max(float(lengths.max(initial=0.0)) * 1e-9, 1e-300))
    scaled = rows / lengths  # all entries are of the order of one, whatever the units
    size = max(float(np.linalg.norm(goal)), 1e-300)
    hessian = scaled.T @ scaled + least**2 * np.eye(len(lengths))
    bounds = np.concatenate([low * lengths / size, -high * lengths / size])
    sides = np.concatenate([np.eye(len(lengths)), -np.eye(len(lengths))], axis=1)
    real = np.isfinite(bounds)
    given = (sides[:, real], bounds[real]) if real.any() else ()
    found = quadprog.solve_qp(hessian, scaled.T @ (goal / size), *given)[0] * size / lengths
    near = AT_BOUND * size / lengths
    return np.where(found <= low + near, low, np.where(found >= high - near, high, found))

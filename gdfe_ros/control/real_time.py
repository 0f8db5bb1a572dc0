# SPDX-License-Identifier: Apache-2.0
"""Open-loop control in real time: commands are returned at once, and the model is solved in a separate thread."""

from __future__ import annotations

import threading
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from gdfe_ros.control.feedback import FeedbackControl
from gdfe_ros.control.inverse import Reach
from gdfe_ros.control.targets import Aim
from gdfe_ros.errors import GdfeError
from gdfe_ros.simulation import Command, Simulation

LONGEST_CLOSE = 60.0
"""Longest time [s] that `RealTimeControl.close` waits for the model's present step."""


class RealTimeControl:
    """Controller for moving goals that returns commands without waiting for the model's equilibrium.

    A command is computed in less than a millisecond, from the model's last equilibrium and its Jacobian. A separate
    thread solves the model for the latest commands, as fast as possible. The new equilibrium corrects the next command,
    like a measurement in `FeedbackControl`.

    Args:
        simulation: model without dynamics; until `close`, only this object may step it.
        targets: targets to control; a probe's name means its position along all axes.
        actuators: names of the actuators; None: all.
        tolerance: distance [m] at which a goal counts as reached.

    Attributes:
        solves: number of equilibria that the model has found.
        failed: message of the model's last step if it found no equilibrium; empty otherwise. After a failure, the next
            commands are computed from the last equilibrium.

    Raises:
        CommandError: there is no such probe or actuator, the scene has dynamics, or the tolerance is not positive.
        GdfeError: the model's state has no derivative.

    Example:
        >>> with RealTimeControl(model, [Target(probe="tip", axes=(0, 2))]) as control:
        ...     commands = control.command([goal], dt=0.02).commands
    """

    def __init__(
        self,
        simulation: Simulation,
        targets: Sequence[Aim | str],
        *,
        actuators: Sequence[str] | None = None,
        tolerance: float = 1e-5,
    ) -> None:
        self._feedback = FeedbackControl(simulation, targets, actuators=actuators, tolerance=tolerance)
        self._simulation = simulation
        self.solves, self.failed = 0, ""
        self._wanted: dict[str, float] | None = None
        self._changed, self._closed = threading.Condition(), False
        self._thread = threading.Thread(target=self._solve_on, name="model of real-time control", daemon=True)
        self._thread.start()

    def __enter__(self) -> RealTimeControl:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def command(self, goals: ArrayLike, dt: float) -> Reach:
        """Return the commands that approach goals (t, 3) within the next ``dt`` [s], limited by ranges and rates.

        Distances and message are those of `FeedbackControl.command`, but refer to the model's last equilibrium.

        Raises:
            CommandError: goals or time are not allowed; nothing has changed.
        """
        with self._changed:
            found = self._feedback.command(goals, dt)
            self._wanted = dict(found.commands)
            self._changed.notify_all()
        return found

    def close(self) -> None:
        """Stop the thread after its present step."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        self._thread.join(LONGEST_CLOSE)

    def _solve_on(self) -> None:
        """Step the model to the latest commands until the object is closed."""
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._closed or self._wanted is not None)
                if self._closed:
                    return
                wanted, self._wanted = self._wanted, None
            self._follow(wanted)

    def _follow(self, wanted: dict[str, float]) -> None:
        """Step the model to commands and pass its equilibrium to the controller; on failure, restore the model."""
        before = self._simulation.snapshot()
        try:
            result = self._simulation.step(
                Command(actuators=wanted), dt=self._feedback.time_to(wanted, before.commands)
            )
            message = "" if result.converged else result.message or "the model's step did not converge"
        except GdfeError as error:
            message = str(error)
        if message:
            self._simulation.restore(before)
            with self._changed:
                self.failed = message
            return
        values = np.array([target.value(self._simulation) for target in self._feedback.targets])
        with self._changed:
            self._feedback.observe(values, wanted)
            self.solves, self.failed = self.solves + 1, ""

# SPDX-License-Identifier: Apache-2.0
"""Feedback control that moves a probe to the position to which a viewer drags it; the shown states are the feedback."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.errors import GdfeError
from gdfe_ros.live.interface import ShownRun, View
from gdfe_ros.node.driving.orders import ActuatorOrder

STILL = 1e-6
"""Commands count as constant if their relative change is below this."""
INTERVAL = 0.02
"""Duration of a command [s], for the rate limits of actuators."""
ENOUGH = 1e6
"""Duration of the model's step to the present commands [s]; it is so long that rate limits have no effect."""
SLEW = 1.0
"""Shortest time in which a command crosses its range [s]; for a node under the wall clock, the default is 0.5 s."""
LEARNING = 0.6
"""Parameter ``learning`` of the control without dynamics. With dynamics it is 0, because the oscillations of the body
would give wrong corrections of the Jacobian.
"""


class Leading:
    """Converts the goal of a probe to orders for the actuators, one order for each shown state.

    When a viewer first drags a probe, a model for the control is built and solved in a separate thread. A goal is
    dropped in four cases: it is reached, the commands no longer change, another source commands an actuator, or the
    model or a command fails.

    Args:
        session: the commanded run.
        say: function that receives a text for the viewers.
    """

    def __init__(self, session: ShownRun, say: Callable[[str], None]) -> None:
        self._session, self._say = session, say
        self._lock = threading.Lock()
        self._probe = self._making = ""
        self._goal: NDArray[np.float64] | None = None
        self._control = None
        self._view: View | None = None
        self._own: list[dict[str, float]] = []

    def set_goal(self, probe: str, goal: NDArray[np.float64]) -> None:
        """Set the goal (3,) [m] of a probe, and send the first commands towards it."""
        with self._lock:
            self._goal, self._own = np.array(goal, dtype=np.float64), []
            if probe != self._probe:
                self._probe, self._control = probe, None
            if self._control is None:
                self._make()
                return
        self.send_next(self._view)

    def send_next(self, view: View | None) -> None:
        """Send the next commands, computed from the state ``view``; None: from the last state."""
        with self._lock:
            self._view = view or self._view
            if self._goal is None or self._control is None or self._view is None:
                return
            before = {name: self._session.commands[name] for name in self._control.names}
            if self._own and not any(_same(before, each) for each in self._own):
                self._goal = None  # another source commands the actuators
                return
            place = self._session.scene.probes[self._probe].at(np.asarray(self._view.positions, dtype=np.float64))
            self._control.observe(place, before)
            found = self._control.command([self._goal], INTERVAL)
            changes = [abs(found.commands[name] - value) / max(abs(value), 1e-12) for name, value in before.items()]
            if found.reached or max(changes) < STILL:
                self._goal = None
                if found.message:
                    self._say(found.message)
                return
            self._own = [before, dict(found.commands)]
        try:
            self._session.command("actuation", ActuatorOrder(found.commands))
        except GdfeError as error:
            with self._lock:
                self._goal = None
            self._say(str(error))

    def _make(self) -> None:
        """Start a thread that builds the control of the probe, unless such a thread is running."""
        if self._making != self._probe:
            self._making = self._probe
            threading.Thread(target=self._build, args=(self._probe,), name="model of a probe", daemon=True).start()

    def _build(self, probe: str) -> None:
        # Imported here, so that the page opens before the compiler is imported.
        from gdfe_ros.control import FeedbackControl, Target
        from gdfe_ros.scene.loader import scene_from_text
        from gdfe_ros.simulation import Command, Simulation

        control, session = None, self._session
        try:
            scene = session.scene
            model = Simulation(scene_from_text(scene.source, origin="of the page", overrides={"dynamics": None}))
            actuators = {each.name for each in scene.actuators}
            handles = {name: pose for name, pose in session.targets.items() if name in model.rest_command().handles}
            commands = {name: value for name, value in session.commands.items() if name in actuators}
            model.step(Command(actuators=commands, handles=handles), dt=ENOUGH)
            learning = LEARNING if scene.dynamics is None else 0.0
            given = {"tolerance": 1e-4 * scene.mesh.size, "learning": learning, "slew": SLEW}
            control = FeedbackControl(model, [Target(probe=probe)], **given)
        except GdfeError as error:
            self._say(f"{probe} cannot be dragged: {error}")
        with self._lock:
            self._making = ""
            if probe == self._probe:
                self._control, self._goal = control, self._goal if control else None
        self.send_next(None)


def _same(commands: Mapping[str, float], others: Mapping[str, float]) -> bool:
    """Return whether commands are equal up to the rounding of a slider."""
    return all(abs(value - others[name]) <= STILL * max(abs(value), 1e-12) for name, value in commands.items())

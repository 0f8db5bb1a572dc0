# SPDX-License-Identifier: Apache-2.0
"""Playback of a scene's program to a node: after each step of the node, orders for the next step are published."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from time import monotonic

from gdfe_ros.live.programme import Programme
from gdfe_ros.node.orders import Order
from gdfe_ros.recording.step_record import Begin, StepRecord
from gdfe_ros.scene.scene import Scene

LOST = 1.0
"""Orders are repeated after this wall time without a step [s]. If an order or the record of a step is lost, a node that
waits for commands makes no step.
"""


class Player:
    """Plays the program of a scene; the program begins at the first step that is received after `play`.

    Args:
        scene: scene with the program.
        send: function that publishes an order, given a name and the order.
    """

    def __init__(self, scene: Scene, send: Callable[[str, Order], None]) -> None:
        self._scene, self._send = scene, send
        self._programme: Programme | None = None
        self._time = self._next = 0.0
        self._begun, self._given = False, 0.0

    @property
    def text(self) -> str:
        """Text with the progress of the program; empty while no program is played."""
        programme = self._programme
        if programme is None:
            return ""
        moment = max(0.0, self._time - programme.start)
        return f"plays the program, {moment:.2f} of {programme.duration:g} s"

    def play(self) -> None:
        """Play the program from its beginning. The first orders are sent at once; a waiting node then makes a step."""
        self._begun, programme = False, Programme(self._scene.program, self._time)
        self._programme = programme
        self._give(programme, self._time)

    def stop(self) -> None:
        """Stop the program."""
        self._programme = None

    def leave(self, names: Iterable[str]) -> None:
        """Stop commanding the named handles, actuators, loads and joints, because a viewer commands them now."""
        if self._programme is not None:
            self._programme.leave(names)

    def follow(self, record: StepRecord) -> None:
        """Receive the record of a step, and send the orders for the next step."""
        back, self._time = record.begin is not Begin.LAST, record.time
        programme = self._programme
        if programme is None:
            return
        if not self._begun:
            # Simulation time may have stood still, or jumped, until this step.
            self._begun, programme.start = True, record.time
            self._give(programme, record.time)
        elif back:
            self._programme = None
        elif programme.over(record.time):
            if not programme.over(self._next):  # unreceived steps may have passed the end
                self._give(programme, record.time)
            self._programme = None
        else:
            self._give(programme, record.time + record.dt)

    def remind(self) -> None:
        """Repeat the last orders if no step has followed for a while."""
        programme = self._programme
        if programme is not None and monotonic() - self._given > LOST:
            self._give(programme, self._next)

    def _give(self, programme: Programme, time: float) -> None:
        self._next, self._given = time, monotonic()
        programme.give(time, self._send)

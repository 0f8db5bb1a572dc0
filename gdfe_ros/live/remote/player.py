# SPDX-License-Identifier: Apache-2.0
"""Plays a scene's program to a node: orders over its topics, at the pace of the steps that it tells of."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from time import monotonic

from gdfe_ros.live.programme import Programme
from gdfe_ros.node.orders import Order
from gdfe_ros.recording.step_record import Begin, StepRecord
from gdfe_ros.scene.scene import Scene

LOST = 1.0
"""Wall time [s] without a step after which it is commanded again: an order, or the word of a step, may be lost, and a
node at rest makes none by itself."""


class Player:
    """One program at a time; it begins at the first step that is heard after `play`.

    Args:
        scene: whose program it is.
        send: publishes an order of a name.
    """

    def __init__(self, scene: Scene, send: Callable[[str, Order], None]) -> None:
        self._scene, self._send = scene, send
        self._programme: Programme | None = None
        self._time = self._next = 0.0
        self._begun, self._given = False, 0.0

    @property
    def text(self) -> str:
        """What is played, and how far; empty where nothing is."""
        programme = self._programme
        if programme is None:
            return ""
        moment = max(0.0, self._time - programme.start)
        return f"plays the program, {moment:.2f} of {programme.duration:g} s"

    def play(self) -> None:
        """Begin anew, with what is commanded at the program's beginning: a node at rest makes a step of it."""
        self._begun, programme = False, Programme(self._scene.program, self._time)
        self._programme = programme
        self._give(programme, self._time)

    def stop(self) -> None:
        """Command nothing any more."""
        self._programme = None

    def leave(self, names: Iterable[str]) -> None:
        """Leave handles, actuators and loads to the viewer."""
        if self._programme is not None:
            self._programme.leave(names)

    def follow(self, record: StepRecord) -> None:
        """Hear of a step, and command the one that comes next."""
        back, self._time = record.begin is not Begin.LAST, record.time
        programme = self._programme
        if programme is None:
            return
        if not self._begun:
            # Time may have stood, or leapt, until this step.
            self._begun, programme.start = True, record.time
            self._give(programme, record.time)
        elif back:
            self._programme = None
        elif programme.over(record.time):
            if not programme.over(self._next):  # steps of which nothing was heard led past the end
                self._give(programme, record.time)
            self._programme = None
        else:
            self._give(programme, record.time + record.dt)

    def remind(self) -> None:
        """Command again what no step has followed for a while."""
        programme = self._programme
        if programme is not None and monotonic() - self._given > LOST:
            self._give(programme, self._next)

    def _give(self, programme: Programme, time: float) -> None:
        self._next, self._given = time, monotonic()
        programme.give(time, self._send)

# SPDX-License-Identifier: Apache-2.0
"""Live pages in this process, and viewers of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from gdfe_ros.live.page import Page
from gdfe_ros.live.session import LiveSession
from gdfe_ros.scene import Scene, scene_from_text
from gdfe_ros.simulation import Simulation
from test.live.viewer import Viewer

BAR = """
name: pulled
mesh: {bar: {size: [0.1, 0.02, 0.02], cells: [6, 1, 1]}}
materials: {rubber: {law: neo_hookean, young: 0.5e6, poisson: 0.45, density: 1000}}
regions: [{material: rubber}]
handles:
  base: {where: {face: x-}, fixed: true}
  tip: {where: {face: x+}}
actuators:
  lower: {cable: {points: [[0, 0, -0.008], [0.05, 0, -0.008]], range: [0, 2]}}
  left: {cable: {points: [[0, 0.008, 0], [0.05, 0.008, 0]], range: [0, 2]}}
loads: {weight: {gravity: [0, 0, -9.81]}}
probes: {middle: [0.05, 0, 0]}
program:
  duration: 1.0
  handles: {tip: [{time: 1.0, translation: [0, 0, 0.02]}]}
  actuators:
    lower: [{time: 1.0, value: 1.0}]
    left: [{time: 0.5, value: 0.0}, {time: 1.0, value: 1.0}]
"""
"""A bar with every kind of command."""


class Live:
    """A page with its session, closed at the end of the test.

    Attributes:
        page: the page.
        session: the session.
        viewers: viewers made by ``look``.
    """

    def __init__(self, scene: Scene, **options: Any) -> None:
        self.page = Page(host="127.0.0.1", port=8600, frames=30.0)
        self.session = LiveSession(Simulation(scene), on_view=self.page.show_view, warn=self.page.say, **options)
        self.page.show(self.session)
        self.session.start()
        self.viewers: list[Viewer] = []

    def look(self) -> Viewer:
        """Connect a viewer, and wait until it has received the whole page."""
        viewer = Viewer(self.page.address())
        self.viewers.append(viewer)
        viewer.wait(lambda: viewer.frames and "converged" in viewer.text(), "the page")
        return viewer

    def close(self) -> None:
        """Close the viewers, the session and the page."""
        for viewer in self.viewers:
            viewer.__exit__(None, None, None)
        self.session.stop()
        self.page.close()


@pytest.fixture
def bar() -> str:
    """Return the bar's scene text."""
    return BAR


@pytest.fixture
def live() -> Iterator[Callable[..., Live]]:
    """Give a function that makes a live page of the bar, or another body, with additional lines of its scene."""
    made: list[Live] = []

    def make(*, body: str = BAR, motion: str = "", **options: Any) -> Live:
        made.append(Live(scene_from_text(body + motion, origin="of a test"), **options))
        return made[-1]

    yield make
    for each in made:
        each.close()

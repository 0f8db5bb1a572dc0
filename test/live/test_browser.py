# SPDX-License-Identifier: Apache-2.0
"""The live page in a real Chromium, operated as by a user."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from typing import Any

import pytest

from docs.scripts.browser import Browser
from gdfe_ros.live.surface import DrawnSurface
from test.live.wire import Wire


def test_a_user_moves_a_slider_and_resets(live: Callable[..., Any]) -> None:
    """After a slider is moved and the page reset, the simulation has followed, and the console has no message."""
    page = live()
    session = page.session
    with Browser(DrawnSurface(session.scene.mesh), size=(900, 650)) as browser:
        browser.open(page.page.address("127.0.0.1"))
        browser.wait(lambda: "converged" in browser.text() and "lower, tension [N]" in browser.text(), "the page")
        browser.nudge(0)
        browser.wait(lambda: session.simulation.commands["lower"] > 0.0, "the slider's command")
        browser.press("reset")
        browser.wait(lambda: session.last.record.time == 0.0, "the reset")
        browser.wait(lambda: "0.000 s" in browser.text(), "the state")
        assert browser.complaints() == []


def test_a_user_drags_a_handle(live: Callable[..., Any]) -> None:
    """Dragging the tip's upward arrow with the mouse moves the drawn surface up."""
    page = live()
    session, mesh = page.session, page.session.scene.mesh
    with Browser(DrawnSurface(mesh), size=(900, 650)) as browser, closing(Wire(browser.chrome)) as wire:
        browser.open(page.page.address("127.0.0.1"))
        browser.wait(lambda: "converged" in browser.text(), "the page")
        browser.dismiss()
        browser.drag_control(session.scene, session.scene.handles[1], (0, 0, 1), pixels=60.0)
        browser.wait(lambda: session.simulation.targets["tip"].translation[2] > 0.1 * mesh.size, "the drag")
        browser.settle()
        x, y, z = session.simulation.targets["tip"].translation
        assert abs(x) + abs(y) < 1e-6 * mesh.size
        assert session.last.poses["tip"].translation[2] == pytest.approx(z)
        assert browser.frames()[-1][1] > browser.frames()[0][1]
        reached = list(wire.totals())
        assert reached[-1] > reached[0]
        assert len(reached) >= len(browser.frames()) - 2  # two were there before any step
        assert browser.complaints() == []

# SPDX-License-Identifier: Apache-2.0
"""The live page in a real Chromium, driven as a user would."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from benchmarks.live.browser import Browser
from gdfe_ros.live.surface import Surface


def test_a_user_moves_a_slider_and_resets(live: Callable[..., Any]) -> None:
    """Nudge a slider, reset: the simulation follows, and the console is silent."""
    page = live()
    session = page.session
    with Browser(Surface(session.scene.mesh), size=(900, 650)) as browser:
        browser.open(page.page.port)
        browser.wait(lambda: "converged" in browser.text() and "lower, tension [N]" in browser.text(), "the page")
        browser.nudge(0)
        browser.wait(lambda: session.simulation.commands["lower"] > 0.0, "the slider's command")
        browser.press("reset")
        browser.wait(lambda: session.last.record.time == 0.0, "the reset")
        browser.wait(lambda: "0.000 s" in browser.text(), "the state")
        assert browser.complaints() == []

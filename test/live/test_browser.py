# SPDX-License-Identifier: Apache-2.0
"""The live page in a real Chromium, driven as a user would."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.live.browser import Browser
from gdfe_ros.live.surface import Surface

_ARROW = 0.75
"""Of the length of a control's arrow: where it is gripped."""


def test_a_user_moves_a_slider_drags_a_handle_and_resets(live: Callable[..., Any]) -> None:
    """Nudge a slider, drag a control's arrow up with the mouse, reset: the body follows, and the console is silent."""
    page = live()
    session = page.session
    with Browser(Surface(session.scene.mesh), size=(900, 650)) as browser:
        browser.open(page.page.port)
        browser.wait(lambda: "converged" in browser.text() and "lower, tension [N]" in browser.text(), "the page")
        browser.nudge(0)
        browser.wait(lambda: session.simulation.commands["lower"] > 0.0, "the slider's command")
        last = browser.frames()[-1][1]
        browser.drag(*_grip(page))
        lifted = browser.wait(lambda: session.simulation.targets["tip"].translation[2], "the drag")
        assert lifted > 0.0
        browser.wait(lambda: browser.frames()[-1][1] != last, "a body that has moved")
        browser.press("reset")
        browser.wait(lambda: session.last.record.time == 0.0, "the reset")
        browser.wait(lambda: "0.000 s" in browser.text(), "the state")
        assert browser.complaints() == []


def _grip(page: Any) -> tuple[tuple[float, float], tuple[float, float]]:
    """Give where in the window the upward arrow of the tip's control is, and a way along it [px]."""
    camera = next(iter(page.page._server.get_clients().values())).camera
    control = page.page._stage._controls["tip"]
    w, x, y, z = camera.wxyz
    turn, ends = Rotation.from_quat([x, y, z, w]).inv(), []
    for share in (_ARROW, 2.0 * _ARROW):
        right, down, far = turn.apply(control.position + np.array([0.0, 0.0, share * control.scale]) - camera.position)
        focus = 0.5 * camera.image_height / np.tan(0.5 * camera.fov)
        ends.append((0.5 * camera.image_width + focus * right / far, 0.5 * camera.image_height + focus * down / far))
    (left, top), (right, up) = ends
    return (left, top), (right - left, up - top)

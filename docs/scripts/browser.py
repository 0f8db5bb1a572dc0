# SPDX-License-Identifier: Apache-2.0
"""A Chromium that shows a live page, is operated like a user operates it, and reports what is drawn and when."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from types import TracebackType
from typing import Any

import numpy as np
from selenium.common.exceptions import TimeoutException
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

from docs.scripts.chromium import PATIENCE, start
from gdfe_ros.constraints import Handle
from gdfe_ros.live.stage import CONTROL, first_view, scale_of
from gdfe_ros.live.surface import DrawnSurface
from gdfe_ros.scene import Scene

_FIELD = np.radians(75.0)
"""Vertical field of view of viser's camera [rad]."""
_WATCH = """
window.gdfe = {frames: [], draws: 0, keys: []};
const now = () => (performance.timeOrigin + performance.now()) / 1e3;
const proto = WebGL2RenderingContext.prototype, fill = proto.bufferData, draw = proto.drawElements;
let place = 0;
proto.bufferData = function (target, data, usage) {
  // Each frame fills three buffers of this size: positions, colours, normals.
  if (data && data.byteLength === %(bytes)d && place++ %% 3 === 0) {
    let sum = 0;
    for (let i = 0; i < data.length; i += 7) sum += data[i];
    window.gdfe.frames.push([now(), sum]);
  }
  return fill.apply(this, arguments);
};
proto.drawElements = function (mode, count) {
  if (count === %(indices)d) window.gdfe.draws += 1;
  return draw.apply(this, arguments);
};
window.addEventListener("keydown", () => window.gdfe.keys.push(now()), true);
"""


class Browser:
    """A headless Chromium; a context manager.

    Args:
        surface: drawn surface of the body that the page shows.
        size: size of the window [px].

    Attributes:
        chrome: driver of the browser.
    """

    def __init__(self, surface: DrawnSurface, *, size: tuple[int, int] = (1100, 700)) -> None:
        self.chrome = start(size, reachable="127.0.0.1")
        source = _WATCH % {"bytes": 12 * surface.count, "indices": surface.triangles.size}
        self.chrome.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": source})

    def __enter__(self) -> Browser:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.chrome.quit()

    def open(self, address: str) -> None:
        """Open a page of this machine, and wait until its body is drawn."""
        self.chrome.get(address)
        self.wait(lambda: self.ask("return window.gdfe && window.gdfe.draws > 0"), "a body that is drawn")

    def wait(self, done: Callable[[], Any], what: str) -> Any:
        """Call ``done`` until it returns a true value, and return this value.

        Raises:
            TimeoutError: there is no true value within `PATIENCE`.
        """
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            try:
                if found := done():
                    return found
            except TimeoutException:
                continue
            time.sleep(0.02)
        raise TimeoutError(f"waited {PATIENCE:g} s for {what} in vain")

    def ask(self, script: str) -> Any:
        """Run a script in the page and return its result."""
        return self.chrome.execute_script(script)

    def frames(self) -> list[tuple[float, float]]:
        """Return, for each drawn frame, its wall time [s] and the sum of its vertex positions."""
        return [tuple(frame) for frame in self.ask("return window.gdfe.frames")]

    def dismiss(self) -> None:
        """Close the page's note about drawing without a graphics card, because it covers the body."""
        found = "return document.querySelector('.mantine-Notification-closeButton')"
        self.wait(lambda: self.ask(found), "the note").click()
        self.wait(lambda: not self.ask(found), "the note's end")

    def settle(self) -> None:
        """Wait until no new frame has been drawn for a second."""
        quiet = "const last = window.gdfe.frames.at(-1)[0]; return Date.now() / 1e3 - last > 1"
        self.wait(lambda: self.ask(quiet), "a body that rests")

    def text(self) -> str:
        """Return all text of the page."""
        return self.ask("return document.body.innerText")

    def nudge(self, place: int) -> float:
        """Press the right arrow key on a slider, and return the wall time [s] at which the page received the key."""
        slider = self.chrome.find_elements(By.CSS_SELECTOR, "[role=slider]")[place]
        slider.send_keys(Keys.ARROW_RIGHT)
        return self.ask("return window.gdfe.keys.at(-1)")

    def drag(self, start: tuple[float, float], way: tuple[float, float], *, steps: int = 8) -> None:
        """Drag the mouse with its left button pressed, from ``start`` [px] by ``way`` [px], in ``steps`` steps."""
        places = [
            [origin + part * step / steps for origin, part in zip(start, way, strict=True)] for step in range(steps + 1)
        ]
        self._mouse("mouseMoved", (start[0] - 3, start[1]))
        self._mouse("mouseMoved", start)
        self._mouse("mousePressed", start, buttons=1)
        for place in places[1:]:
            self._mouse("mouseMoved", place, buttons=1)
        self._mouse("mouseReleased", places[-1])

    def drag_control(self, scene: Scene, handle: Handle, axis: Sequence[float], *, pixels: float) -> None:
        """Drag the head of an arrow of a handle's control in the direction of the arrow.

        Args:
            scene: scene of the page; the camera must not have moved since the page was opened.
            handle: handle in its rest pose.
            axis: direction of the arrow (3,).
            pixels: length of the path [px].
        """
        mesh, view = scene.mesh, first_view(scene)
        scale = scale_of(mesh)
        foot = scale * handle.centre(mesh.vertices)
        head = foot + 0.9 * CONTROL * scale * mesh.size * np.array(axis)
        start, end = np.array(self._project(foot, view)), np.array(self._project(head, view))
        self.drag(tuple(end), tuple(pixels * (end - start) / np.linalg.norm(end - start)))

    def _project(self, point: Sequence[float], view: tuple[Any, Any]) -> tuple[float, float]:
        """Return the position of a point in the window [px].

        Args:
            point: (3,) in the units of the picture.
            view: point at which the camera looks, and position of the camera, (3,) each.
        """
        script = "const box = document.querySelector('canvas').getBoundingClientRect();"
        left, top, width, height = self.ask(f"{script} return [box.x, box.y, box.width, box.height]")
        middle, eye = map(np.asarray, view)
        ahead = (middle - eye) / np.linalg.norm(middle - eye)
        right = np.cross(ahead, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        away = np.subtract(point, eye)
        unit = 0.5 * height / (away @ ahead * np.tan(0.5 * _FIELD))
        return left + 0.5 * width + unit * (away @ right), top + 0.5 * height - unit * (away @ np.cross(right, ahead))

    def _mouse(self, kind: str, place: Sequence[float], *, buttons: int = 0) -> None:
        given = {"type": kind, "x": place[0], "y": place[1], "button": "none", "buttons": buttons}
        if kind != "mouseMoved":
            given |= {"button": "left", "clickCount": 1}
        self.chrome.execute_cdp_cmd("Input.dispatchMouseEvent", given)

    def press(self, label: str) -> None:
        """Press the button with a label."""
        xpath = f"//button[normalize-space(.)='{label}']"
        self.wait(lambda: self.chrome.find_elements(By.XPATH, xpath), label)[0].click()

    def complaints(self) -> list[str]:
        """Return the error messages of the console since the last call."""
        return [entry["message"] for entry in self.chrome.get_log("browser") if entry["level"] == "SEVERE"]

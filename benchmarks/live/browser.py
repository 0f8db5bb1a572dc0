# SPDX-License-Identifier: Apache-2.0
"""A Chromium that looks at a live page, and tells when frames of the body reach the graphics card."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from types import TracebackType
from typing import Any

from selenium import webdriver
from selenium.common.exceptions import TimeoutException
from selenium.webdriver.common.actions.action_builder import ActionBuilder
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

from gdfe_ros.errors import GdfeError
from gdfe_ros.live.surface import Surface

PATIENCE = 300.0
"""Longest wait for the browser [s]: without a graphics card it draws with the processor."""
_BROWSERS = ("chromium", "chromium-browser", "google-chrome")
_OPTIONS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-dev-shm-usage",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    # The page must open offline: no name resolves.
    "--host-resolver-rules=MAP * ~NOTFOUND , EXCLUDE 127.0.0.1",
)
_WATCH = """
window.gdfe = {frames: [], draws: 0, keys: []};
const proto = WebGL2RenderingContext.prototype, fill = proto.bufferData, draw = proto.drawElements;
let place = 0;
proto.bufferData = function (target, data, usage) {
  // Each frame fills three buffers of this size: positions, colours, normals.
  if (data && data.byteLength === %(bytes)d && place++ %% 3 === 0) {
    let sum = 0;
    for (let i = 0; i < data.length; i += 7) sum += data[i];
    window.gdfe.frames.push([performance.now(), sum]);
  }
  return fill.apply(this, arguments);
};
proto.drawElements = function (mode, count) {
  if (count === %(indices)d) window.gdfe.draws += 1;
  return draw.apply(this, arguments);
};
window.addEventListener("keydown", () => window.gdfe.keys.push(performance.now()), true);
"""


class Browser:
    """A headless Chromium; a context manager.

    Args:
        surface: of the body that it will see.
        size: of the window [px].
    """

    def __init__(self, surface: Surface, *, size: tuple[int, int] = (1100, 700)) -> None:
        program, driver = next(filter(None, map(shutil.which, _BROWSERS)), None), shutil.which("chromedriver")
        if program is None or driver is None:
            raise GdfeError("this needs Chromium and its driver: make browser, or apt-get install chromium-driver")
        options = webdriver.ChromeOptions()
        options.binary_location = program
        for option in (*_OPTIONS, "--window-size={},{}".format(*size)):
            options.add_argument(option)
        options.page_load_strategy = "none"  # no request waits for the page: on a busy machine it would time out
        options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
        self.chrome = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
        self.chrome.set_script_timeout(100.0)  # below the 120 s after which a request counts as lost
        source = _WATCH % {"bytes": 12 * surface.count, "indices": surface.triangles.size}
        self.chrome.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": source})

    def __enter__(self) -> Browser:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.chrome.quit()

    def open(self, port: int) -> None:
        """Open a page of this machine, and wait until its body is drawn."""
        self.chrome.get(f"http://127.0.0.1:{port}/")
        self.wait(lambda: self.ask("return window.gdfe && window.gdfe.draws > 0"), "a body that is drawn")

    def wait(self, done: Callable[[], Any], what: str) -> Any:
        """Ask until there is an answer that is true, and return it.

        Raises:
            TimeoutError: it took too long.
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
        """Run a script in the page and return what it returns."""
        return self.chrome.execute_script(script)

    def frames(self) -> list[tuple[float, float]]:
        """Give time [ms] and a sum of the positions of each frame so far."""
        return [tuple(frame) for frame in self.ask("return window.gdfe.frames")]

    def dismiss(self) -> None:
        """Close what the page says of drawing without a graphics card."""
        found = "return document.querySelector('.mantine-Notification-closeButton')"
        if button := self.ask(found):
            button.click()
            self.wait(lambda: not self.ask(found), "the note's end")

    def settle(self) -> None:
        """Wait until nothing new has been drawn for a second."""
        quiet = "const last = window.gdfe.frames.at(-1)[0]; return performance.now() - last > 1000"
        self.wait(lambda: self.ask(quiet), "a body that rests")

    def text(self) -> str:
        """Give all text of the page."""
        return self.ask("return document.body.innerText")

    def nudge(self, place: int) -> float:
        """Press the right arrow on a slider, and return when the page had it [ms]."""
        slider = self.chrome.find_elements(By.CSS_SELECTOR, "[role=slider]")[place]
        slider.send_keys(Keys.ARROW_RIGHT)
        return self.ask("return window.gdfe.keys.at(-1)")

    def drag(self, start: tuple[float, float], way: tuple[float, float], *, steps: int = 6) -> None:
        """Drag the mouse from a place in the window along a way [px]."""
        mouse = ActionBuilder(self.chrome, duration=50)
        mouse.pointer_action.move_to_location(round(start[0] - 3), round(start[1]))
        mouse.pointer_action.move_to_location(*map(round, start)).pointer_down()
        for step in range(1, steps + 1):
            place = [origin + part * step / steps for origin, part in zip(start, way, strict=True)]
            mouse.pointer_action.move_to_location(*map(round, place))
        mouse.pointer_action.pointer_up()
        mouse.perform()

    def press(self, label: str) -> None:
        """Press a button by its label."""
        xpath = f"//button[normalize-space(.)='{label}']"
        self.wait(lambda: self.chrome.find_elements(By.XPATH, xpath), label)[0].click()

    def complaints(self) -> list[str]:
        """Give what the console has said of errors since the last call."""
        return [entry["message"] for entry in self.chrome.get_log("browser") if entry["level"] == "SEVERE"]

# SPDX-License-Identifier: Apache-2.0
"""Draws the pictures of the live page in the documentation: screenshots of Chromium while scenes are played.

python -m docs.scripts.live_pictures [SCENE ...]
"""

from __future__ import annotations

import sys
from pathlib import Path

from docs.scripts.browser import Browser
from gdfe_ros.live.interface import View
from gdfe_ros.live.page import Page
from gdfe_ros.live.session import LiveSession
from gdfe_ros.live.surface import DrawnSurface
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation

IMAGES = Path(__file__).parent.parent / "images"
MOMENTS = {
    "tendon_finger": ("live.png", 1.25, 0.25),
    "finger_press": ("live_contact.png", 3.0, 0.1),
    "pneunet": ("live_chambers.png", 1.0, 0.1),
}
"""Dict from scene to the picture's file, its simulation time [s], and the time step [s]."""


def main() -> None:
    """Play each scene's program in Chromium, pause it at its moment, and write a screenshot."""
    for name in sys.argv[1:] or MOMENTS:
        file, moment, dt = MOMENTS[name]
        draw(name, IMAGES / file, moment=moment, dt=dt)


def draw(name: str, path: Path, *, moment: float, dt: float) -> None:
    """Draw a scene at a ``moment`` of its program [s], which is reached in steps of ``dt`` [s]."""
    scene = load_scene(name)
    page = Page(host="127.0.0.1", port=8780, frames=30.0)

    def told(view: View) -> None:
        page.show_view(view)
        if view.record.time > moment - dt / 2:
            session.stepper.pause(True)

    session = LiveSession(Simulation(scene), dt=dt, on_view=told, warn=page.say)
    page.show(session)
    session.start()
    try:
        with Browser(DrawnSurface(scene.mesh), size=(1300, 800)) as browser:
            browser.open(page.address("127.0.0.1"))
            browser.press("play the program")
            time = f"{moment:.3f} s"
            browser.wait(lambda: "paused" in browser.text() and time in browser.text(), "the moment")
            browser.dismiss()
            browser.settle()
            browser.chrome.save_screenshot(str(path))
            print(path, time, browser.complaints() or "no errors")
    finally:
        session.stop()
        page.close()


if __name__ == "__main__":
    main()

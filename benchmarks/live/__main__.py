# SPDX-License-Identifier: Apache-2.0
"""Measure the live page: python -m benchmarks.live [--scene pneunet] [--reloads 100]."""

from __future__ import annotations

import argparse
import os
import re
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from benchmarks.live.browser import Browser
from benchmarks.live.cost import leftovers, shares
from benchmarks.live.wire import Arrival
from gdfe_ros.live.stage import scale_of
from gdfe_ros.live.surface import DrawnSurface
from gdfe_ros.node.interface.scene_topics import is_commanded
from gdfe_ros.scene import Scene, load_scene

_CELLS = [28, 8, 8]
"""Cells of a bar whose steps take little time."""
_WINDOW = (900, 500)
"""Size of the browser's window [px]. It is small because pages are rendered without a graphics card."""


def main() -> None:
    """Print a row for each figure, and the load of the machine."""
    parser = argparse.ArgumentParser(description="What the live page does in a real Chromium, and what it costs.")
    parser.add_argument("--scene", default="pneunet")
    parser.add_argument("--rounds", type=int, default=5, help="plays with and without viewers")
    parser.add_argument("--reloads", type=int, default=100)
    parser.add_argument("--viewers", type=int, default=10, help="that look at once")
    parser.add_argument("--seconds", type=float, default=10.0, help="in which frames are counted")
    parser.add_argument("--pictures", type=Path, help="directory of screenshots")
    parser.add_argument("--without-browser", action="store_true")
    parser.add_argument("--only-browser", action="store_true")
    arguments = parser.parse_args()
    scene = load_scene(arguments.scene)
    print(f"| {scene.name}, {scene.mesh.n_cells} cells | figure | asked for |\n|---|---|---|")
    if not arguments.only_browser:
        _in_process(scene, arguments)
    if not arguments.without_browser:
        _watch(scene, arguments)
        _drag(arguments)
    _row("load of the machine, cores", f"{os.getloadavg()[0]:.1f}, {os.cpu_count()}", "")


def _in_process(scene: Scene, arguments: argparse.Namespace) -> None:
    """Print the page's cost for the solver, and the resources that viewers leave behind."""
    asked = {"one viewer": "less than 10 % longer", "a viewer that hangs": "as without", "processor": "10 %"}
    for case, share in shares(scene, rounds=arguments.rounds).items():
        text = (
            "processor time of the page over the solver's" if case == "processor" else f"time of a step beside {case}"
        )
        _row(text, f"{100 * share:.1f} %" + " of that alone" * (case != "processor"), asked[case])
    left = leftovers(scene, reloads=arguments.reloads, at_once=arguments.viewers)
    counts = ", ".join(str(arguments.reloads * place) for place in range(len(left["threads"])))
    what = f"after {counts} reloads, {arguments.viewers} viewers at once before each"
    for name, unit, asked in (("threads", "", "as many"), ("memory", " MiB", "as much"), ("objects", "", "as many")):
        _row(f"{name} {what}", ", ".join(f"{value:.0f}" for value in left[name]) + unit, asked)


@contextmanager
def _served(name: str, *options: str) -> Iterator[tuple[str, float]]:
    """Run ``gdfe live`` for a scene; yield its address and the wall time of its start [s]."""
    started = time.time()
    command = [sys.executable, "-m", "gdfe_ros.cli", "live", name, "--port", "8750", *options]
    # Without this variable, Python stores compiled modules, so that the second start is a warm one.
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
        try:
            yield process.stdout.readline().split()[2], started
        finally:
            process.terminate()


def _watch(scene: Scene, arguments: argparse.Namespace) -> None:
    """Open the page, move a slider, play the program; print delays and frame rates."""
    with _served(arguments.scene):
        pass  # The first start is a cold one.
    with Browser(DrawnSurface(scene.mesh), size=_WINDOW) as browser, _served(arguments.scene) as (address, started):
        ready = time.time()
        browser.open(address.replace("localhost", "127.0.0.1"))
        drawn, first = time.time() - started, next(browser.wire.arrivals()).moment
        opened = browser.wire.connected
        _row("start of the command until a frame reaches the browser", f"{first - started:.2f} s", "3 s")
        parts = {
            "the command says its address": ready - started,
            "the browser loads the page": opened - ready,
            "the frame is sent": first - opened,
        }
        _row("of which " + ", ".join(parts), ", ".join(f"{part:.2f} s" for part in parts.values()), "")
        _row("start of the command until the body is drawn, by the processor", f"{drawn:.2f} s", "")
        reached, drawn = _delays(browser)
        _row("slider's move until the moved body reaches the browser", f"{reached:.0f} ms", "100 ms")
        _row("slider's move until it is drawn, by the processor", f"{drawn:.0f} ms", "")
        _play(browser, scene, arguments.seconds, dt=0.01)
        _finish(browser, scene, arguments)


def _drag(arguments: argparse.Namespace) -> None:
    """Drag the tip of a bar upwards with the mouse, then play its program with more steps per second than frames."""
    scene = load_scene("bend5", overrides={"mesh.bar.cells": _CELLS})
    options = ("--set", f"mesh.bar.cells={_CELLS}", "--dt", "0.001")
    with Browser(DrawnSurface(scene.mesh), size=_WINDOW) as browser, _served(scene.name, *options) as (address, _):
        browser.open(address.replace("localhost", "127.0.0.1"))
        browser.dismiss()
        browser.settle()
        before = list(browser.wire.arrivals())[-1]
        handle = next(handle for handle in scene.handles if is_commanded(handle))
        browser.drag_control(scene, handle, (0, 0, 1), pixels=60.0)
        seen: list[Arrival] = []

        def arrived() -> bool:
            seen.extend(browser.wire.arrivals())
            return any(frame.total > before.total for frame in seen)

        browser.wait(arrived, "a body that goes along")
        browser.settle()
        seen.extend(browser.wire.arrivals())
        way = (seen[-1].total - before.total) / DrawnSurface(scene.mesh).count / scale_of(scene.mesh)
        what = f"{scene.name}, {scene.mesh.n_cells} cells: rise of the surface"
        _row(f"{what} where {handle.name} is dragged up by 60 px with the mouse", f"{way:.4f} m", "")
        _play(browser, scene, min(arguments.seconds, 4.0), dt=0.001)
        _finish(browser, scene, arguments)


def _play(browser: Browser, scene: Scene, seconds: float, *, dt: float) -> None:
    """Play the program for some ``seconds``; print the rates of frames and of steps of ``dt`` [s]."""
    browser.press("play the program")
    time.sleep(1.0)
    list(browser.wire.arrivals())
    begun, first = time.time(), _simulated(browser)
    time.sleep(seconds)
    steps = (_simulated(browser) - first) / dt / (time.time() - begun)
    moments = [arrival.moment for arrival in browser.wire.arrivals()]
    span = moments[-1] - moments[0]
    drawn = sum(moments[0] < moment <= moments[-1] for moment, _ in browser.frames())
    what = f"{scene.name}: frames a second of its program"
    _row(f"{what} that reach the browser", f"{(len(moments) - 1) / span:.1f}", "30")
    _row(f"{what} that the processor draws", f"{drawn / span:.1f}", "")
    _row(f"{scene.name}: steps a second meanwhile; more frames there cannot be", f"{steps:.1f}", "")
    browser.press("pause")
    browser.settle()


def _simulated(browser: Browser) -> float:
    """Return the simulation time [s] that the page shows."""
    return float(re.search(r"([\d.]+) s, (?:\d+|no) steps", browser.text())[1])


def _finish(browser: Browser, scene: Scene, arguments: argparse.Namespace) -> None:
    """Save a screenshot, and print errors on the console."""
    if arguments.pictures:
        arguments.pictures.mkdir(parents=True, exist_ok=True)
        browser.chrome.save_screenshot(str(arguments.pictures / f"live_{scene.name}.png"))
    _row(f"{scene.name}: errors on the console", "; ".join(browser.complaints())[:200] or "none", "none")


def _delays(browser: Browser, *, moves: int = 9) -> tuple[float, float]:
    """Move the first slider; return two median delays [ms]: until the changed body arrives, and until it is drawn."""
    reached, drawn = [], []
    for _ in range(moves):
        browser.settle()
        last = [*browser.frames()][-1][1]
        list(browser.wire.arrivals())
        pressed = browser.nudge(0)
        browser.wait(lambda last=last: browser.frames()[-1][1] != last, "a body that moves")
        drawn.append(next(at for at, total in browser.frames() if at > pressed and total != last) - pressed)
        reached.append(next(frame.moment for frame in browser.wire.arrivals() if frame.moment > pressed) - pressed)
    return 1e3 * statistics.median(reached), 1e3 * statistics.median(drawn)


def _row(what: str, figure: str, asked: str) -> None:
    print(f"| {what} | {figure} | {asked} |", flush=True)


if __name__ == "__main__":
    main()

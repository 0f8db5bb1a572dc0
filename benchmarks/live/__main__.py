# SPDX-License-Identifier: Apache-2.0
"""Measure the live page: python -m benchmarks.live [--scene pneunet] [--reloads 100]."""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path

from benchmarks.live.browser import Browser
from benchmarks.live.cost import leftovers, shares
from gdfe_ros.live.surface import Surface
from gdfe_ros.scene import Scene, load_scene


def main() -> None:
    """Print a row for each figure, and how busy the machine is."""
    parser = argparse.ArgumentParser(description="What the live page does in a real Chromium, and what it costs.")
    parser.add_argument("--scene", default="pneunet")
    parser.add_argument("--rounds", type=int, default=5, help="plays with and without viewers")
    parser.add_argument("--reloads", type=int, default=100)
    parser.add_argument("--viewers", type=int, default=10, help="that look at once")
    parser.add_argument("--seconds", type=float, default=10.0, help="in which frames are counted")
    parser.add_argument("--pictures", type=Path, help="directory of screenshots")
    parser.add_argument("--without-browser", action="store_true")
    arguments = parser.parse_args()
    scene = load_scene(arguments.scene)
    print(f"| {scene.name}, {scene.mesh.n_cells} cells | figure | asked for |\n|---|---|---|")
    for case, share in shares(scene, rounds=arguments.rounds).items():
        text = "time of the page's threads over the stepper's" if case == "processor" else f"steps beside {case}"
        _row(text, f"{100 * share:.1f} % of those alone" if case != "processor" else f"{100 * share:.1f} %", "")
    left = leftovers(scene, reloads=arguments.reloads, at_once=arguments.viewers)
    what = f"after {arguments.reloads} reloads, {arguments.viewers} viewers at once"
    _row(f"threads {what}", "{:.0f} from {:.0f}".format(*left["threads"][::-1]), "as many")
    _row(f"memory {what}", "{:.1f} from {:.1f} MiB".format(*left["memory"][::-1]), "as much")
    if not arguments.without_browser:
        _in_browser(scene, arguments)
    _row("load of the machine, cores", f"{os.getloadavg()[0]:.1f}, {os.cpu_count()}", "")


def _in_browser(scene: Scene, arguments: argparse.Namespace) -> None:
    with Browser(Surface(scene.mesh)) as browser:
        started = time.perf_counter()
        command = [sys.executable, "-m", "gdfe_ros.cli", "live", arguments.scene, "--port", "8750"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            try:
                port = int(process.stdout.readline().split("localhost:")[1].split()[0])
                ready = time.perf_counter() - started
                browser.open(port)
                _row("start of the command until the body is drawn", f"{time.perf_counter() - started:.1f} s", "3 s")
                _row("of which until the page can be opened", f"{ready:.1f} s", "")
                _row("slider's move until the moved body is drawn", f"{_delay(browser):.0f} ms", "100 ms")
                browser.press("play the program")
                time.sleep(arguments.seconds)
                drawn = [moment for moment, _ in browser.frames()]
                moments = [moment for moment in drawn if moment > drawn[-1] - 5e3]
                rate = 1e3 * (len(moments) - 1) / (moments[-1] - moments[0])
                _row("frames that reach the graphics card while it plays", f"{rate:.1f} a second", "30")
                browser.press("pause")
                time.sleep(1.0)
                if arguments.pictures:
                    arguments.pictures.mkdir(parents=True, exist_ok=True)
                    browser.chrome.save_screenshot(str(arguments.pictures / f"live_{scene.name}.png"))
                complaints = browser.complaints()
                _row("errors on the console", "; ".join(complaints)[:200] or "none", "none")
            finally:
                process.terminate()


def _delay(browser: Browser, *, moves: int = 7) -> float:
    """Nudge the first slider again and again; give the median time until another body is drawn [ms]."""
    delays = []
    for _ in range(moves):
        time.sleep(1.0)
        last = browser.frames()[-1][1]
        pressed = browser.nudge(0)
        browser.wait(lambda last=last: browser.frames()[-1][1] != last, "a body that moves")
        delays.append(next(at for at, total in browser.frames() if at > pressed and total != last) - pressed)
    return statistics.median(delays)


def _row(what: str, figure: str, asked: str) -> None:
    print(f"| {what} | {figure} | {asked} |", flush=True)


if __name__ == "__main__":
    main()

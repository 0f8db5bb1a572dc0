# SPDX-License-Identifier: Apache-2.0
"""``gdfe report``: write a recorded run as an HTML page, a picture, and on request an animation."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from gdfe_ros.commands.waiting import waiting
from gdfe_ros.errors import GdfeError
from gdfe_ros.recording.bag_info import bag_directory
from gdfe_ros.terminal import PlainConsole

BESIDE = Path()
"""Value of ``--gif`` without a file name: the animation is written beside the report."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("bag", type=Path, help="directory of a bag that sim_node recorded, or of its run")
    parser.add_argument(
        "--out", type=Path, metavar="FILE.html", help="page to write (default: <bag>_report.html beside the bag)"
    )
    for kind, text in (("gif", "also draw the motion"), ("mp4", "also draw the motion, as a video (extra 'video')")):
        parser.add_argument(
            f"--{kind}",
            type=Path,
            nargs="?",
            const=BESIDE,
            metavar=f"FILE.{kind}",
            help=f"{text}; default: beside the page",
        )
    parser.add_argument("--frames", type=int, default=40, help="number of frames of the GIF or video (default: 40)")
    parser.add_argument(
        "--field",
        default="eps_eq",
        help="field that colours the pictures: eps_eq, J, omega, tangent or energy_density (default: eps_eq)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Write the HTML page, the PNG and, on request, the animation; return 0."""
    from gdfe_ros.analysis.report.pictures import draw_steps, require_video, write_gif, write_mp4, write_png
    from gdfe_ros.analysis.report.writer import write_report

    if arguments.mp4:
        require_video()
    if arguments.out is not None and arguments.out.suffix.lower() not in (".html", ".htm"):
        text = "a page ends with .html, or no browser opens it"
        raise GdfeError(f"--out {arguments.out}: {text}; remedy: {arguments.out}.html")
    bag = bag_directory(arguments.bag.resolve())
    out = arguments.out or bag.with_name(f"{bag.stem}_report.html")
    console, started = PlainConsole(soft_wrap=True), time.perf_counter()
    with waiting(f"writing {out}"):
        facts = write_report(bag, out)
    elapsed = time.perf_counter() - started
    console.print(
        f"report   {out}: {facts.steps} steps, {facts.frames} frames, {facts.size / 1e6:.1f} MB in {elapsed:.1f} s"
    )
    with waiting("drawing the picture"):
        picture = write_png(bag, out.with_suffix(".png"), field=arguments.field)
    console.print(f"picture  {picture}")
    if arguments.gif or arguments.mp4:
        with waiting(f"drawing {arguments.frames} frames"):
            pictures = list(draw_steps(bag, field=arguments.field, frames=arguments.frames))
        for path, ending, write in ((arguments.gif, ".gif", write_gif), (arguments.mp4, ".mp4", write_mp4)):
            if path:
                console.print(f"motion   {write(pictures, out.with_suffix(ending) if path == BESIDE else path)}")
    return 0

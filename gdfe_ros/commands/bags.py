# SPDX-License-Identifier: Apache-2.0
"""The commands for bags: ``gdfe export``, ``gdfe recover`` and ``gdfe report``.

``export`` writes files for ParaView, numpy or a spreadsheet. ``recover`` repairs truncated bags. ``report`` writes an
HTML page.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from importlib import import_module
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

from gdfe_ros.commands.waiting import waiting
from gdfe_ros.errors import GdfeError
from gdfe_ros.node.interface import CELL_FIELDS
from gdfe_ros.recording.bag_info import bag_directory
from gdfe_ros.recording.recovery import RecoveryReport, recover
from gdfe_ros.untrusted.regular_file import replacing
from gdfe_ros.untrusted.terminal import PlainConsole, make_table

if TYPE_CHECKING:
    from gdfe_ros.analysis.bag_run import BagRun, BagStep


FORMATS = ("vtk", "npz", "csv", "parquet")
"""Output formats. The suffix of the file determines the format; VTK files are written into a directory."""


def add_export(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``export``."""
    parser.add_argument("bag", type=Path, help="directory of a bag that sim_node recorded, or of its run")
    parser.add_argument(
        "--format",
        "--to",
        choices=FORMATS,
        help="vtk: a series of files for ParaView; npz: all arrays; csv, parquet: a table with one row for each step "
        "(default: by the ending of --out, otherwise vtk)",
    )
    parser.add_argument("--out", type=Path, help="file to write; for vtk, a directory (default: beside the bag)")
    parser.add_argument("--every", type=int, default=1, metavar="N", help="only every Nth step (default: 1)")


def export(arguments: argparse.Namespace) -> int:
    """Export a recorded run; return 0."""
    if arguments.every < 1:
        raise GdfeError(f"--every is {arguments.every}; allowed: 1 or more")
    from gdfe_ros.analysis.bag_run import BagRun, BagSteps

    kind = _format(arguments)
    bag = arguments.bag.resolve()
    out = arguments.out or bag.with_name(f"{bag.stem}_vtk" if kind == "vtk" else f"{bag.stem}.{kind}")
    recorded = BagRun(bag)
    steps = islice(BagSteps(recorded), 0, None, arguments.every)
    print(f"{out}: {_write(kind, steps, recorded, out)} steps")
    return 0


def _format(arguments: argparse.Namespace) -> str:
    """Return one of `FORMATS`: the requested one, else that of the file's suffix."""
    ending = arguments.out.suffix.removeprefix(".") if arguments.out else ""
    kind = arguments.format or ending or "vtk"
    if kind not in FORMATS:
        raise GdfeError(
            f"--out ends with .{ending}; allowed: {', '.join(FORMATS)}; remedy: another ending, or --format"
        )
    return kind


def _write(kind: str, steps: Iterator[BagStep], recorded: BagRun, out: Path) -> int:
    from gdfe_ros.analysis.export import Columns, step_row, write_csv, write_npz, write_parquet, write_vtk_series

    if kind == "vtk":
        return write_vtk_series(steps, recorded.scene.mesh, out)
    with replacing(out) as written:
        if kind == "npz":
            return write_npz(steps, recorded.scene, written)
        known = Columns(recorded.scene)
        rows = [step_row(step, known) for step in steps]
        write = write_csv if kind == "csv" else write_parquet
        write(rows, written, known)
        return len(rows)


def add_recover(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``recover``."""
    parser.add_argument("bag", type=Path, help="directory of the bag, or one MCAP file; it is not changed")
    parser.add_argument(
        "--out", type=Path, help="directory of the new bag (default: <name>_recovered, beside the old one)"
    )


def write_recovered(arguments: argparse.Namespace) -> int:
    """Write a new bag with the recovered contents; return 0."""
    report = recover(arguments.bag, arguments.out)
    console, heads = PlainConsole(), ("topic", "messages", "missing before the last one")
    rows = [(topic, str(count), str(report.missing.get(topic, 0))) for topic, count in report.messages.items()]
    console.print(make_table(f"recovered {report.path}", heads, rows, right=heads[1:]))
    for text in _remarks(report):
        console.print(text)
    console.print(f"{report.total} messages in {report.path}", soft_wrap=True)
    return 0


def _remarks(report: RecoveryReport) -> list[str]:
    remarks = (
        *((True, f"{name} was cut off: data after its last complete record are lost") for name in report.cut_files),
        (report.damaged_chunks, f"{report.damaged_chunks} chunks did not match their checksum and were left out"),
        (report.damaged_records, f"{report.damaged_records} other records could not be read and were left out"),
        (not report.run, "its scene is lost: replay and report cannot read the new bag; rosbag2 and Foxglove can"),
        (report.orphans, f"{report.orphans} messages were left out: the declaration of their topic is lost"),
    )
    return [text for applies, text in remarks if applies] or ["the bag was complete"]


BESIDE = Path()
"""Value of ``--gif`` without a file name: the animation is written beside the report."""


def add_report(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``report``."""
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
        choices=CELL_FIELDS,
        default="eps_eq",
        help="field that colours the pictures (default: eps_eq)",
    )


def write_page(arguments: argparse.Namespace) -> int:
    """Write the HTML page, the PNG and, on request, the animation; return 0."""
    from gdfe_ros.analysis.report.pictures import draw_steps, write_gif, write_mp4, write_png
    from gdfe_ros.analysis.report.report_writer import write_report

    if arguments.mp4:
        import_module("av")  # missing, it is named before anything is written
    if arguments.out is not None and arguments.out.suffix.lower() not in (".html", ".htm"):
        text = "a page ends with .html, or no browser opens it"
        raise GdfeError(f"--out {arguments.out}: {text}; remedy: {arguments.out}.html")
    if arguments.frames < 1:
        raise GdfeError(f"--frames is {arguments.frames}; allowed: 1 or more")
    bag = bag_directory(arguments.bag.resolve())
    out = arguments.out or bag.with_name(f"{bag.stem}_report.html")
    console, started = PlainConsole(soft_wrap=True), time.perf_counter()
    with waiting(f"writing {out}"), replacing(out) as written:
        facts = write_report(bag, written)
    elapsed = time.perf_counter() - started
    console.print(
        f"report   {out}: {facts.steps} steps, {facts.frames} frames, {facts.size / 1e6:.1f} MB in {elapsed:.1f} s"
    )
    with waiting("drawing the picture"), replacing(out.with_suffix(".png")) as written:
        write_png(bag, written, field=arguments.field)
    console.print(f"picture  {out.with_suffix('.png')}")
    if arguments.gif or arguments.mp4:
        with waiting(f"drawing {arguments.frames} frames"):
            pictures = list(draw_steps(bag, field=arguments.field, frames=arguments.frames))
        for path, ending, write in ((arguments.gif, ".gif", write_gif), (arguments.mp4, ".mp4", write_mp4)):
            if path:
                path = out.with_suffix(ending) if path == BESIDE else path
                with replacing(path) as written:
                    write(pictures, written)
                console.print(f"motion   {path}")
    return 0


COMMANDS = {
    "export": (add_export, export),
    "recover": (add_recover, write_recovered),
    "report": (add_report, write_page),
}

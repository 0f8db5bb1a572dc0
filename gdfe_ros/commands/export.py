# SPDX-License-Identifier: Apache-2.0
"""``gdfe export``: export a recorded run for ParaView, numpy, or a spreadsheet."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from enum import Enum
from itertools import islice
from pathlib import Path

from gdfe_ros.analysis.bag_run import BagRun, BagStep, BagSteps
from gdfe_ros.errors import GdfeError


class Format(Enum):
    """Output format. The suffix of the file determines it; VTK files are written into a directory."""

    VTK = "vtk"
    NPZ = "npz"
    CSV = "csv"
    PARQUET = "parquet"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("bag", type=Path, help="directory of a bag that sim_node recorded, or of its run")
    parser.add_argument(
        "--format",
        "--to",
        choices=[kind.value for kind in Format],
        help="vtk: a series of files for ParaView; npz: all arrays; csv, parquet: a table with one row for each step "
        "(default: by the ending of --out, otherwise vtk)",
    )
    parser.add_argument("--out", type=Path, help="file to write; for vtk, a directory (default: beside the bag)")
    parser.add_argument("--every", type=int, default=1, metavar="N", help="only every Nth step (default: 1)")


def run(arguments: argparse.Namespace) -> int:
    """Export a recorded run; return 0."""
    if arguments.every < 1:
        raise GdfeError(f"--every is {arguments.every}; allowed: 1 or more")
    kind = _format(arguments)
    bag = arguments.bag.resolve()
    out = arguments.out or bag.with_name(f"{bag.stem}_vtk" if kind is Format.VTK else f"{bag.stem}.{kind.value}")
    recorded = BagRun(bag)
    steps = islice(BagSteps(recorded), 0, None, arguments.every)
    print(f"{out}: {_write(kind, steps, recorded, out)} steps")
    return 0


def _format(arguments: argparse.Namespace) -> Format:
    if arguments.format:
        return Format(arguments.format)
    ending = arguments.out.suffix.removeprefix(".") if arguments.out else ""
    endings = [kind.value for kind in Format]
    if ending and ending not in endings:
        raise GdfeError(
            f"--out ends with .{ending}; allowed: {', '.join(endings)}; remedy: another ending, or --format"
        )
    return Format(ending) if ending else Format.VTK


def _write(kind: Format, steps: Iterator[BagStep], recorded: BagRun, out: Path) -> int:
    if kind is Format.VTK:
        from gdfe_ros.analysis.export import write_vtk_series

        return write_vtk_series(steps, recorded.mesh, out)
    if kind is Format.NPZ:
        from gdfe_ros.analysis.export import write_npz

        return write_npz(steps, recorded.scene, out)
    from gdfe_ros.analysis.export import Columns, step_row, write_csv, write_parquet

    known = Columns(recorded.scene.actuators)
    rows = [step_row(step, known) for step in steps]
    {Format.CSV: write_csv, Format.PARQUET: write_parquet}[kind](rows, out, known)
    return len(rows)

# SPDX-License-Identifier: Apache-2.0
"""Options of several commands: overrides of a scene, numbers, output files, workers."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from gdfe_ros.analysis.workers import connect
from gdfe_ros.errors import GdfeError
from gdfe_ros.quantity import Quantity
from gdfe_ros.untrusted.bounded_text import plain_lines

if TYPE_CHECKING:
    from distributed import Client


def require_number(option: str, value: float | None, quantity: Quantity) -> None:
    """Raise an error if an option is given and its value is not finite or out of the quantity's range.

    Raises:
        GdfeError: the error names the option, the value and the allowed range.
    """
    if value is None:
        return
    try:
        quantity.check(value)
    except ValueError as error:
        hint = f"; {value:g} mm are {1e-3 * value:g}" if quantity.unit == "m" and 1.0 <= value < math.inf else ""
        raise GdfeError(f"{option} = {value:g}; {error}{hint}") from error


def say(text: str) -> None:
    """Print a text to standard error at once, with its control characters escaped."""
    print(plain_lines(text), file=sys.stderr, flush=True)


def add_overrides(parser: argparse.ArgumentParser, text: str) -> None:
    """Declare ``--set``, which may be given several times; ``text`` describes it."""
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help=text)


def require_picture(path: Path | None) -> None:
    """Raise an error if the folder of a picture is missing, or its format is unknown; None passes.

    Raises:
        GdfeError: the error names the file, and the allowed formats or the remedy.
    """
    if path is None:
        return
    from matplotlib.backend_bases import FigureCanvasBase  # matplotlib takes a second to import

    require_ending("--picture", path, [f".{name}" for name in sorted(FigureCanvasBase.filetypes)])
    require_folder("--picture", path)


def require_ending(option: str, path: Path | None, endings: Sequence[str]) -> None:
    """Raise an error if a path has an ending that is not among ``endings``; None and a path without one pass.

    Raises:
        GdfeError: the error names the option, the file, and the allowed endings.
    """
    if path is not None and path.suffix and path.suffix.lower() not in endings:
        raise GdfeError(f"{option} {path}: unknown format {path.suffix!r}; allowed: {', '.join(endings)}")


def require_folder(option: str, path: Path | None) -> None:
    """Raise an error if the folder of a file is missing, or if the path is a folder itself; None passes.

    Raises:
        GdfeError: the error names the option, the file, and the remedy.
    """
    if path is None:
        return
    if path.is_dir():
        raise GdfeError(f"{option} {path}: this is a folder; remedy: the path of a file in it")
    if not path.parent.is_dir():
        raise GdfeError(f"{option} {path}: there is no folder {path.parent}; remedy: make it, or another path")


def add_workers(parser: argparse.ArgumentParser) -> None:
    """Declare ``--workers`` and ``--scheduler``; without dask the default is this process alone."""
    default = 2 if find_spec("distributed") else 1
    text = "number of processes on this machine (default: 2; without the extra sweep 1)"
    parser.add_argument("--workers", type=count_processes, default=default, metavar="N", help=text)
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="address of the scheduler of your own dask cluster, instead of --workers"
    )


def open_client(arguments: argparse.Namespace) -> AbstractContextManager[Client | None]:
    """Return a context manager that connects to the workers and yields their client.

    It yields None if a single worker on this machine was requested; the work is then done in this process.
    """
    if arguments.scheduler is None and arguments.workers == 1:
        return nullcontext()
    return connect(arguments.scheduler, arguments.workers)


def count_processes(text: str) -> int:
    """Return the number of processes that an option states; raise an ArgumentTypeError if it is not 1 or more."""
    if not (text.strip().isdecimal() and int(text) > 0):
        raise argparse.ArgumentTypeError(f"{text!r} is no number of processes; allowed: 1 or more")
    return int(text)

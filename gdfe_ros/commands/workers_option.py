# SPDX-License-Identifier: Apache-2.0
"""The options ``--workers`` and ``--scheduler`` of the commands that compute in parallel."""

from __future__ import annotations

import argparse
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING

from gdfe_ros.workers import connect

if TYPE_CHECKING:
    from distributed import Client


def add_workers(parser: argparse.ArgumentParser) -> None:
    """Declare ``--workers`` and ``--scheduler``."""
    parser.add_argument(
        "--workers", type=_count, default=2, metavar="N", help="number of processes on this machine (default: 2)"
    )
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="address of the scheduler of your own dask cluster, instead of --workers"
    )


def open_client(arguments: argparse.Namespace) -> AbstractContextManager[Client | None]:
    """Return the context of the client of the workers; it yields None, for this process, with a single worker here."""
    if arguments.scheduler is None and arguments.workers == 1:
        return nullcontext()
    return connect(arguments.scheduler, arguments.workers)


def _count(text: str) -> int:
    if not (text.strip().isdecimal() and int(text) > 0):
        raise argparse.ArgumentTypeError(f"{text!r} is no number of processes; allowed: 1 or more")
    return int(text)

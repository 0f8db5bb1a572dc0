# SPDX-License-Identifier: Apache-2.0
"""The option ``--workers`` of the commands that compute in parallel."""

from __future__ import annotations

import argparse


def add_workers(parser: argparse.ArgumentParser) -> None:
    """Declare ``--workers``."""
    parser.add_argument(
        "--workers", type=_count, default=2, metavar="N", help="number of processes on this machine (default: 2)"
    )


def _count(text: str) -> int:
    if not (text.strip().isdecimal() and int(text) > 0):
        raise argparse.ArgumentTypeError(f"{text!r} is no number of processes; allowed: 1 or more")
    return int(text)

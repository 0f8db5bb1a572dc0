# SPDX-License-Identifier: Apache-2.0
"""``gdfe topics``: list the topics of all nodes with their types, publishers and subscriptions."""

from __future__ import annotations

import argparse

from gdfe_ros.node.peer import open_peer


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("part", nargs="?", default="", help="list only topics whose names contain this text")


def run(arguments: argparse.Namespace) -> int:
    """Print a line for each topic; return 0, or 1 if no topic is listed."""
    with open_peer() as peer:
        found = [row for row in peer.topics() if arguments.part in row[0]]
    rows = [("topic", "type", "publishers", "subscriptions"), *found]
    widths = [max(len(str(row[column])) for row in rows) for column in range(3)]
    for *cells, last in rows:
        print(*(f"{cell!s:{width}}" for cell, width in zip(cells, widths, strict=True)), last)
    return 0 if found else 1

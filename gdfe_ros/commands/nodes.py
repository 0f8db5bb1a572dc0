# SPDX-License-Identifier: Apache-2.0
"""``gdfe nodes``: list the nodes."""

from __future__ import annotations

import argparse

from gdfe_ros.node.peer import open_peer


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""


def run(arguments: argparse.Namespace) -> int:
    """Print the full name of each node; return 0."""
    with open_peer() as peer:
        print(*peer.nodes(), sep="\n")
    return 0

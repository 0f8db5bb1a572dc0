# SPDX-License-Identifier: Apache-2.0
"""``gdfe hz``: measure the rate of a topic."""

from __future__ import annotations

import argparse

import numpy as np

from gdfe_ros.errors import GdfeError
from gdfe_ros.node.peer import full_name, open_peer


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("topic", help="name of the topic, e.g. /gdfe_sim/mesh")
    parser.add_argument("--count", type=int, default=50, help="number of messages to measure, at most (default: 50)")
    parser.add_argument(
        "--seconds", type=float, default=5.0, metavar="S", help="end after this time, with two messages (default: 5 s)"
    )
    parser.add_argument(
        "--wait", type=float, default=10.0, metavar="S", help="longest wait for each message (default: 10 s)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the rate and the intervals between messages; return 0."""
    if arguments.count < 2:
        raise GdfeError(f"--count {arguments.count}; allowed: 2 or more")
    times: list[float] = []
    with open_peer() as peer:
        for time in peer.arrivals(arguments.topic, patience=arguments.wait):
            times.append(time)
            late = len(times) > 1 and time - times[0] > arguments.seconds
            if late or len(times) == arguments.count:
                break
    gaps = np.diff(times)
    print(
        f"{full_name(arguments.topic)}: {1.0 / gaps.mean():.4g} Hz; intervals of {len(times)} messages: "
        f"{1e3 * gaps.min():.3g} to {1e3 * gaps.max():.3g} ms, standard deviation {1e3 * gaps.std():.2g} ms"
    )
    return 0

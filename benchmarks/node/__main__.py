# SPDX-License-Identifier: Apache-2.0
"""``make bench-node``: measure the node, print the tables, write bench_node.json."""

from __future__ import annotations

import os
import statistics
import sys
from dataclasses import asdict

from rich.console import Console
from rich.table import Table

from benchmarks.node import cost, flood, idle, latency, lockstep
from benchmarks.node.client import CELLS, height
from benchmarks.node.tables import all_rows
from benchmarks.replay import figures
from benchmarks.report import options, write_report
from gdfe_ros.constraints import Pose
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Command, Simulation

LARGEST_SHARE = 0.15
"""Largest fraction of a step of 1250 elements for the node's own cost, with mesh, strain and bag."""
LARGEST_BARE = 0.3
"""Largest own cost of the node per step [ms], without subscriber and bag."""
MISSED = 1
PROBED = 20
"""Number of steps of the probe."""


def main() -> int:
    """Make all measurements or the requested ones; return 1 if a target is missed."""
    parser = options("benchmarks.node", "Latency, cost, idleness of a node, floods of commands.", "bench_node")
    parser.add_argument("--steps", type=int, default=300, help="steps of each latency")
    parser.add_argument("--repeats", type=int, default=3, help="runs of each cost, of which the median is taken")
    parser.add_argument("--seconds", type=float, default=20.0, help="of each idle node")
    parser.add_argument("--commands", type=int, default=100_000, help="bad ones, in two scenes")
    given = parser.parse_args()
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    console = Console()
    with console.status("measuring ..."):
        costs = [_cost(given.repeats, **case) for case in cost.CASES]
        latencies = [latency.measure(elements, steps=given.steps) for elements in CELLS]
        idles = [idle.measure(case, seconds=given.seconds) for case in idle.CASES]
        steps = lockstep.measure(5000)
        floods = [flood.measure(scene, count=given.commands // len(flood.SCENES)) for scene in flood.SCENES]
    report = {
        "latency": [asdict(item) for item in latencies],
        "cost": [asdict(item) for item in costs],
        "idle": [asdict(item) for item in idles],
        "lockstep": asdict(steps),
        "floods": [asdict(item) for item in floods],
    }
    for name, (heads, rows) in all_rows(report).items():
        table = Table(*heads, title=name)
        for row in rows:
            table.add_row(*row)
        console.print(table)
    write_report(given.out, report, probe())
    missed = missed_targets(costs, idles, steps, floods)
    console.print(*[f"MISSED: {text}" for text in missed] or ["every target is met"], sep="\n")
    console.print(f"written: {given.out}")
    return MISSED if missed else 0


def probe() -> dict[str, float]:
    """Return the figures of the first steps of both bars, without a node."""
    found: dict[str, float] = {}
    for elements in (500, 1250):
        simulation = Simulation(load_scene("bend5", overrides={"mesh.bar.cells": list(CELLS[elements])}))
        lifts = (Command(handles={"tip": Pose((0.0, 0.0, height(number)))}) for number in range(1, PROBED + 1))
        found |= figures(f"{elements} elements", map(simulation.step, lifts), simulation)
    return found


def _cost(repeats: int, **case: object) -> cost.Cost:
    """Return the run with the median own cost of the node."""
    runs = [cost.measure(**case) for _ in range(repeats)]
    middle = statistics.median_low(run.delay for run in runs)
    return next(run for run in runs if run.delay == middle)


def missed_targets(
    costs: list[cost.Cost], idles: list[idle.Idleness], steps: lockstep.Lockstep, floods: list[flood.Flood]
) -> list[str]:
    """Return a message for each missed target."""
    texts = []
    for item in costs:
        if not item.subscribed and item.delay > LARGEST_BARE:
            texts.append(f"{item.elements} elements, nobody listens: {item.delay:.3f} ms, at most {LARGEST_BARE}")
        if item.recorded and item.delay > LARGEST_SHARE * item.period:
            texts.append(f"{item.elements} elements, recorded: {item.delay / item.period:.1%} of the step")
    texts += [f"idle, {item.case}: {item.share:.2%} of a core" for item in idles if item.share > idle.LARGEST_SHARE]
    if steps.consumed != steps.sent:
        texts.append(f"lockstep: {steps.sent - steps.consumed} commands lost")
    for item in floods:
        if item.refused != item.sent or not item.finite or item.moved or item.status or item.memory > flood.MOST_GROWTH:
            texts.append(f"bad commands: {item}")
    return texts


if __name__ == "__main__":
    sys.exit(main())

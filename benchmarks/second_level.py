# SPDX-License-Identifier: Apache-2.0
"""What the second level saves at equal true error: ``python -m benchmarks.second_level [--robots] [NAME ...]``.

Streams of the torture test's group *honesty*, or the robots' programs in 100 steps, with the kept tangent at a
tolerance of 1e-4, and with the constant matrix alone at the first of ever tighter tolerances whose true error is not
larger than that. The truth is the same stream at 1e-9, with the kept tangent; where it does not get there, a step is
not judged. Times are those of the processor.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from unittest.mock import patch

from benchmarks.markdown import markdown_table
from benchmarks.robots import ROBOTS
from benchmarks.torture.honesty import STREAMS, Stream, error_of, play
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation
from gdfe_ros.solver.equilibrium import slender
from gdfe_ros.solver.result import StepResult

TOLERANCE, TRUTH = 1e-4, 1e-9
TIGHTER = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
NAMES = ("bar 1:10", "bar 1:50", "bar 1:100", "ring", "helix", "shell", "truss", "block with hairs", "hinged chain")
ROBOT_STREAMS = {
    robot.scene: Stream(partial(load_scene, robot.scene), 100, 80 if robot.scene == "two_material_bar" else 100)
    for robot in ROBOTS
}
"""The whole programs of the robots, whose own tolerance is 1e-4, too; ten minutes for all. The drawn-out bar has two
equilibria of the same energy, each the other's mirror image, from 87 of its steps on: neither is the truth."""
LIMIT = 20_000
"""Iterations that a step may take."""
HEADINGS = (
    "stream",
    "error with the kept tangent",
    "iterations a step",
    "ms a step",
    "tolerance without it",
    "error",
    "iterations a step",
    "ms a step",
    "times slower",
)


@dataclass(frozen=True)
class Run:
    """A stream that was played.

    Attributes:
        tolerance: that was asked for.
        results: of its steps.
        seconds: of the processor.
        size: of the body [m].
        error: largest distance of a vertex from the truth in any step, over the body's size; NaN for the truth.
    """

    tolerance: float
    results: tuple[StepResult, ...]
    seconds: float
    size: float
    error: float = float("nan")

    @property
    def cells(self) -> tuple[str, ...]:
        """Iterations and milliseconds a step, as text."""
        count = len(self.results)
        return f"{sum(result.iterations for result in self.results) / count:.1f}", f"{1e3 * self.seconds / count:.3g}"


def main() -> None:
    """Print a row for each stream, and keep the rows."""
    parser = argparse.ArgumentParser(description="Streams with the kept tangent and without it, at equal true error.")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(STREAMS)}")
    parser.add_argument("--robots", action="store_true", help="the programs of the robots instead, or of those named")
    parser.add_argument("--out", type=Path, help="default: runs/bench/second_level.json or robots_level.json")
    arguments = parser.parse_args()
    streams, usual = (ROBOT_STREAMS, tuple(ROBOT_STREAMS)) if arguments.robots else (STREAMS, NAMES)
    rows = [row(name, streams[name]) for name in arguments.names or usual]
    out = arguments.out or Path("runs/bench", "robots_level.json" if arguments.robots else "second_level.json")
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps({"rows": rows}, indent=1))
    print(table(rows))
    print(f"written: {out}")


def table(rows: Sequence[Sequence[str]]) -> str:
    """Return the rows as Markdown."""
    return markdown_table(HEADINGS, rows)


def row(name: str, stream: Stream) -> tuple[str, ...]:
    """Play a stream both ways and return its row."""
    truth = _play(stream, TRUTH)
    level = _against(_play(stream, TOLERANCE), truth)
    alone = next((run for run in _alone(stream, truth) if run.error <= level.error), None)
    head = name, f"{level.error:.1e}", *level.cells
    if alone is None:
        return *head, f"none from {TIGHTER[-1]:g} on", "-", "-", "-", "-"
    ratio = alone.seconds / level.seconds
    return *head, f"{alone.tolerance:g}", f"{alone.error:.1e}", *alone.cells, f"{ratio:.3g}"


def _alone(stream: Stream, truth: Run) -> Iterator[Run]:
    with patch.object(slender, "SLENDER", 0.0):
        for tolerance in TIGHTER:
            yield _against(_play(stream, tolerance), truth)


def _play(stream: Stream, tolerance: float) -> Run:
    scene = stream.scene()
    simulation = Simulation(replace(scene, solver=replace(scene.solver, tolerance=tolerance, max_iterations=LIMIT)))
    simulation.warm_up()
    started = time.process_time()
    results = play(simulation, stream)
    return Run(tolerance, results, time.process_time() - started, size=simulation.mesh.size)


def _against(run: Run, truth: Run) -> Run:
    pairs = [(found, true) for found, true in zip(run.results, truth.results, strict=True) if true.converged]
    return replace(run, error=max(error_of(found, true, run.size) for found, true in pairs))


if __name__ == "__main__":
    main()

# SPDX-License-Identifier: Apache-2.0
"""Time that the second level saves at equal true error: ``python -m benchmarks.second_level [--robots] [NAME ...]``.

The streams are those of the torture test's group *honesty*, or the robots' programs in 100 steps. Each stream runs with
the kept tangent at a tolerance of 1e-4. Then it runs with the constant matrix alone, at decreasing tolerances, until
its true error is not larger. The true error is the distance from the same stream at a tolerance of 1e-9 with the kept
tangent. Steps that do not converge at 1e-9 are not compared. Times are processor times.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from unittest.mock import patch

from benchmarks.markdown import markdown_table
from benchmarks.replay import figures, summed
from benchmarks.report import options, write_report
from benchmarks.robots import ROBOTS
from benchmarks.torture.honesty import STREAMS, Stream, error_of, play
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation
from gdfe_ros.solver.equilibrium import slender
from gdfe_ros.solver.result import StepResult

TOLERANCE, TRUTH = 1e-4, 1e-9
TIGHTER = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
NAMES = ("bar 1:10", "bar 1:50", "bar 1:100", "ring", "helix", "shell", "truss", "block with hairs", "hinged chain")
ROBOT_STREAMS = {robot.scene: Stream(partial(load_scene, robot.scene), 100, 25) for robot in ROBOTS}
"""Streams of the first quarter of the robots' programs; the tolerance of their scenes is 1e-4, too."""
LIMIT = 5000
"""Largest number of iterations of a step; a stream with such a step is not repeated at a smaller tolerance."""
HEADINGS = (
    "stream",
    "with the kept tangent: error",
    "iterations per step",
    "time per step [ms]",
    "without it: tolerance",
    "error",
    "iterations per step",
    "time per step [ms]",
    "time without / with",
)


@dataclass(frozen=True)
class Run:
    """Result of playing a stream.

    Attributes:
        tolerance: requested tolerance.
        results: results of the steps.
        seconds: processor time [s].
        size: size of the body [m].
        error: true error: largest distance of a vertex from its true position in any step, divided by the body's size;
            NaN for the stream that defines the true positions.
    """

    tolerance: float
    results: tuple[StepResult, ...]
    seconds: float
    size: float
    error: float = float("nan")

    @property
    def cells(self) -> tuple[str, ...]:
        """Mean iterations and mean processor time [ms] of a step, as text."""
        count = len(self.results)
        return f"{sum(result.iterations for result in self.results) / count:.1f}", f"{1e3 * self.seconds / count:.3g}"


def main() -> None:
    """Print a row for each stream, and write the report."""
    words = "Streams with the kept tangent and without it, at equal true error."
    parser = options("benchmarks.second_level", words, "second_level")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(STREAMS)}")
    parser.add_argument("--robots", action="store_true", help="the programs of the robots instead, or of those named")
    arguments = parser.parse_args()
    streams, usual = (ROBOT_STREAMS, tuple(ROBOT_STREAMS)) if arguments.robots else (STREAMS, NAMES)
    rows = [row(name, streams[name]) for name in arguments.names or usual]
    write_report(arguments.out, {"rows": rows}, robot_probe() if arguments.robots else probe())
    print(table(rows))
    print(f"written: {arguments.out}")


def probe() -> dict[str, float]:
    """Return the figures of the streams of the bar and of the truss with the kept tangent."""
    return _probe(STREAMS, ("bar 1:10", "truss"))


def robot_probe() -> dict[str, float]:
    """Return the figures of the first steps of every robot."""
    return _probe({name: replace(stream, played=3) for name, stream in ROBOT_STREAMS.items()}, tuple(ROBOT_STREAMS))


def _probe(streams: Mapping[str, Stream], names: Sequence[str]) -> dict[str, float]:
    found: dict[str, float] = {}
    for name in names:
        simulation = _simulation(streams[name], TOLERANCE)
        found |= figures(name, play(simulation, streams[name]), simulation)
    return summed(found)


def table(rows: Sequence[Sequence[str]]) -> str:
    """Return the rows as Markdown, and the number of rows that are faster with the kept tangent."""
    ratios = [float(row[-1]) for row in rows if row[-1] != "-"]
    fast = sum(ratio > 1.0 for ratio in ratios)
    said = f"{len(ratios)} streams reach this error without the kept tangent; {fast} of them are faster with it."
    return f"{markdown_table(HEADINGS, rows)}\n\n{said}"


def row(name: str, stream: Stream) -> tuple[str, ...]:
    """Play a stream with and without the kept tangent and return its row."""
    truth = _play(stream, TRUTH)
    level = _against(_play(stream, TOLERANCE), truth)
    alone = next((run for run in _alone(stream, truth) if run.error <= level.error), None)
    head = name, f"{level.error:.1e}", *level.cells
    if alone is None:
        return *head, f"none in {LIMIT} iterations", "-", "-", "-", "-"
    ratio = alone.seconds / level.seconds
    return *head, f"{alone.tolerance:g}", f"{alone.error:.1e}", *alone.cells, f"{ratio:.3g}"


def _alone(stream: Stream, truth: Run) -> Iterator[Run]:
    with patch.object(slender, "SLENDER", -math.inf):
        for tolerance in TIGHTER:
            run = _play(stream, tolerance)
            yield _against(run, truth)
            if not all(result.converged for result in run.results):
                return


def _play(stream: Stream, tolerance: float) -> Run:
    simulation = _simulation(stream, tolerance)
    started = time.process_time()
    results = play(simulation, stream)
    return Run(tolerance, results, time.process_time() - started, size=simulation.mesh.size)


def _simulation(stream: Stream, tolerance: float) -> Simulation:
    scene = stream.scene()
    simulation = Simulation(replace(scene, solver=replace(scene.solver, tolerance=tolerance, max_iterations=LIMIT)))
    simulation.warm_up()
    return simulation


def _against(run: Run, truth: Run) -> Run:
    pairs = [(found, true) for found, true in zip(run.results, truth.results, strict=True) if true.converged]
    return replace(run, error=max(error_of(found, true, run.size) for found, true in pairs))


if __name__ == "__main__":
    main()

# SPDX-License-Identifier: Apache-2.0
"""Factors of the robots' tangents: LAPACK's band compared with our fronts, in turn: ``python -m benchmarks.factors``.

Times are medians of the processor time of one thread.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from statistics import median
from typing import Any

import numpy as np

from benchmarks.band import Band
from benchmarks.markdown import markdown_table
from benchmarks.report import options, write_report
from benchmarks.robots import ROBOTS
from gdfe_ros.mesh import HexMesh
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation
from gdfe_ros.solver.matrix.fronts import Fronts
from gdfe_ros.solver.matrix.ordering import narrow_order
from gdfe_ros.solver.matrix.springs import Tangent
from gdfe_ros.solver.minimise.level import TangentLevel

REPEATS = 21
HEADINGS = (
    "robot",
    "unknowns",
    "numbers in the band [10^6]",
    "numbers in the fronts [10^6]",
    "factorisation, band [ms]",
    "factorisation, fronts [ms]",
    "solve, band [ms]",
    "solve, fronts [ms]",
)


PROBED = ("tendon_finger", "gripper", "shape_memory_strip")
"""Robots that the probe measures."""


def rows(repeats: int = REPEATS, names: Sequence[str] = ()) -> Iterator[dict[str, Any]]:
    """Return the measurements of every robot; if ``names`` are given, only of these robots."""
    for robot in ROBOTS:
        if names and robot.scene not in names:
            continue
        simulation = Simulation(load_scene(robot.scene))
        list(simulation.play(5))
        minimiser, free = simulation.stepper.equilibrium.minimiser, simulation.stepper.body.unknowns.free
        found = compared(minimiser.level, minimiser.tangent, simulation.mesh, free, repeats)
        yield {"robot": robot.scene, **found}


def probe() -> dict[str, float]:
    """Return the sizes of the factors of three robots."""
    found: dict[str, float] = {}
    for row in rows(1, PROBED):
        sizes = dict(zip(("in the band", "in fronts"), row["entries"], strict=True))
        found |= {f"{row['robot']}: numbers {where}": count for where, count in sizes.items()}
    return found


def compared(level: TangentLevel, tangent: Tangent, mesh: HexMesh, free: np.ndarray, repeats: int) -> dict[str, Any]:
    """Return sizes and times [s] of both kinds of factor of a tangent stiffness."""
    count, graph = level._assembly.free, level._assembly.graph()[: level._assembly.free, : level._assembly.free].tocsr()
    blocks = tangent.blocks[level._among_free]
    points = mesh.vertices[free]
    band, fronts = Band(graph, narrow_order(graph, points)), Fronts(graph, points)
    kinds = band, fronts
    right = np.random.default_rng(0).standard_normal(3 * count)
    factors = [[seconds(lambda kind=kind: kind.factor(blocks)) for kind in kinds] for _ in range(repeats)]
    solves = [[seconds(lambda kind=kind: kind.solve(right)) for kind in kinds] for _ in range(repeats)]
    return {
        "unknowns": 3 * count,
        "entries": [3.0 * count * band.width, float(len(fronts.kept.values))],
        "factor": [median(each) for each in zip(*factors, strict=True)],
        "solve": [median(each) for each in zip(*solves, strict=True)],
    }


def seconds(run: Callable[[], Any]) -> float:
    """Return the processor time [s] of a run."""
    started = time.process_time()
    run()
    return time.process_time() - started


def table(report: Sequence[Mapping[str, Any]]) -> str:
    """Return the table of a report."""
    cells = []
    for row in report:
        times = [f"{1e3 * value:.2g}" for name in ("factor", "solve") for value in row[name]]
        entries = [f"{1e-6 * value:.2g}" for value in row["entries"]]
        cells.append([f"`{row['robot']}`", str(row["unknowns"]), *entries, *times])
    return markdown_table(HEADINGS, cells)


def main() -> None:
    """Run the measurement, write the report and print the table."""
    given = options("benchmarks.factors", "Factors of the robots' tangents.", "factors").parse_args()
    report = list(rows())
    write_report(given.out, report, probe())
    print(table(report))


if __name__ == "__main__":
    main()

# SPDX-License-Identifier: Apache-2.0
"""Cost of exact sensitivities: processor time of a column compared with a cold solve, and solves with the factor.

``python -m benchmarks.sensitivities`` prints a table. The first columns of a state need a new factor; warm columns use
an existing factor.
"""

from __future__ import annotations

import time
from collections.abc import Mapping

from rich.console import Console
from rich.table import Table

from gdfe_ros import Command, Pose, Simulation, load_scene
from gdfe_ros.solver.minimise.level import TangentLevel

CASES: Mapping[str, Command] = {
    "tendon_finger": Command(actuators={"flexor": 3.0}),
    "gripper": Command(actuators={"left": 3e-3, "right": 3e-3, "upper": 2e-3}),
    "three_chamber_arm": Command(actuators={"left": 12e3, "right": 5e3}),
    "bend5": Command(handles={"tip": Pose((0.0, 0.0, 0.02))}),
}
COLUMNS = 6
"""Number of columns of each scene; they belong to its first parameters."""


def measured(scene: str, command: Command) -> list[float]:
    """Return times [ms] of cold solve, factor and warm column, ratio of third to first [%], solves per column."""
    simulation = Simulation(load_scene(scene))
    simulation.step(command)  # compiles
    simulation.sensitivities(["positions"], simulation.parameter_names[:1])
    simulation.reset()
    cold = _timed(lambda: simulation.step(command))
    if not simulation.settled:
        raise RuntimeError(f"{scene} has not converged")
    names, solves, own = simulation.parameter_names[:COLUMNS], [], TangentLevel.solve
    factor = _timed(lambda: simulation.sensitivities(["positions"], []))

    def counted(*given: object) -> None:
        solves.append(0)
        own(*given)

    TangentLevel.solve = counted
    try:
        warm = _timed(lambda: simulation.sensitivities(["positions"], names)) / len(names)
    finally:
        TangentLevel.solve = own
    return [1e3 * cold, 1e3 * factor, 1e3 * warm, 100.0 * warm / cold, len(solves) / len(names)]


def _timed(work: object) -> float:
    before = time.process_time()
    work()
    return time.process_time() - before


def main() -> None:
    """Print the table."""
    table = Table(title="sensitivities, processor time")
    for column in ("scene", "cold solve [ms]", "factor [ms]", "warm column [ms]", "of a cold solve [%]", "solves"):
        table.add_column(column, justify="left" if column == "scene" else "right")
    for scene, command in CASES.items():
        table.add_row(scene, *(f"{number:.1f}" for number in measured(scene, command)))
    Console(width=110).print(table)


if __name__ == "__main__":
    main()

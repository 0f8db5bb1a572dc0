# SPDX-License-Identifier: Apache-2.0
"""The scenes `pick_ur5e` and `pick_panda` with their controller, without ROS: processor time of each phase.

``OPENBLAS_NUM_THREADS=1 NUMBA_NUM_THREADS=1 python -m benchmarks.pick`` prints the table.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence

import numpy as np

from benchmarks.markdown import markdown_table
from gdfe_ros import Command, Simulation, load_scene
from gdfe_ros.examples.pick import forces_of, make_schedule
from gdfe_ros.step_result import StepResult

PHASES = {
    "closes on the box": (0.8, 2.3),
    "lifts the box": (2.3, 3.1),
    "carries the box": (3.1, 4.1),
    "closes on the cube": (7.8, 9.3),
    "lifts the cube": (9.3, 10.1),
    "carries the cube": (10.1, 11.3),
    "holds the cube": (11.3, 12.3),
}
"""Dict from phase to its start and end [s]."""


def play(simulation: Simulation, forces: Sequence[float], *, duration: float) -> Iterator[tuple[StepResult, float]]:
    """Yield the result of each step, and its processor time [s]; the ``forces`` [N] of the fingers are controlled."""
    scene, dt = simulation.scene, simulation.scene.dynamics.step
    schedule, felt = make_schedule(scene, forces), dict.fromkeys(simulation.actuator_names, 0.0)
    for number in range(round(duration / dt)):
        joints = scene.program.joint_positions((number + 1) * dt)
        command = Command(actuators=schedule.commands(number * dt, felt), joints=joints)
        began = time.process_time()
        result = simulation.step(command, dt=dt)
        yield result, time.process_time() - began
        felt = {name: abs(float(sensor.wrench(result)[0])) for name, sensor in scene.sensors.items()}


def measure(name: str) -> dict[str, float]:
    """Return a dict from phase to its processor time over its simulated time.

    Raises:
        AssertionError: a step did not converge.
    """
    simulation = Simulation(load_scene(name))
    simulation.warm_up()
    spent = []
    for result, seconds in play(
        simulation, forces_of(simulation.scene), duration=max(end for _, end in PHASES.values())
    ):
        assert result.converged, result.message
        spent.append(seconds)
    dt = simulation.scene.dynamics.step
    return {
        phase: float(np.mean(spent[round(start / dt) : round(end / dt)])) / dt for phase, (start, end) in PHASES.items()
    }


def main() -> None:
    """Print the table."""
    names = ("pick_ur5e", "pick_panda")
    found = [measure(name) for name in names]
    rows = [[phase, *(f"{each[phase]:.2f}" for each in found)] for phase in PHASES]
    print(markdown_table(("phase", *(f"processor time / simulated time, {name}" for name in names)), rows))


if __name__ == "__main__":
    main()

# SPDX-License-Identifier: Apache-2.0
"""Cost of an obstacle that is never touched: ``python -m benchmarks.far_obstacles``.

Each scene runs without and with the obstacle in one process. The two simulations take turns step by step, so that a
busy machine slows down both. Times are processor times. The percentages are those of the median time of a step, and of
the sums over all steps.
"""

from __future__ import annotations

import statistics
import time

from benchmarks.markdown import markdown_table
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation

FLOOR = {"floor": {"plane": [0.0, 0.0, 1.0], "at": [0.0, 0.0, -20.0], "friction": 0.5, "fixed": True}}
"""An obstacle so far below that the body of no scene approaches it during its program."""
SCENES = {"drop": {}, "swinging_arm": {}, "tendon_finger": {"solver.steps": 40}, "pneunet": {"solver.steps": 20}}
"""Dict from scene to its overrides: two scenes with dynamics and two without, one small and one larger of each kind."""
PLAYS, STEPS = 3, 100
"""Number of runs of each scene, and largest number of steps of a run."""


def play(name: str) -> tuple[list[float], list[float]]:
    """Return the processor times [s] of a scene's steps without and with the obstacle.

    Raises:
        RuntimeError: the obstacle was touched.
    """
    scenes = [load_scene(name, overrides={**SCENES[name], **more}) for more in ({}, {"obstacles": FLOOR})]
    simulations, times = [Simulation(scene) for scene in scenes], ([], [])
    for simulation in simulations:
        simulation.warm_up()
    programs = [simulation.play() for simulation in simulations]
    for step in range(STEPS):
        for which in (0, 1) if step % 2 else (1, 0):
            before = time.process_time()
            result = next(programs[which], None)
            if result is None:
                return times
            times[which].append(time.process_time() - before)
            if which and result.contacts["floor"].presses.any():
                raise RuntimeError(f"{name}: the obstacle is touched at {result.time:g} s")
    return times


def table() -> str:
    """Return the table of all scenes."""
    rows = []
    for name in SCENES:
        plays = [play(name) for _ in range(PLAYS)]
        without, beside = ([each for times in plays for each in times[which]] for which in (0, 1))
        medians = [statistics.median(times) for times in (without, beside)]
        shares = [medians[1] / medians[0], sum(beside) / sum(without)]
        rows.append([name, *(f"{1e3 * median:.2f}" for median in medians), *(f"{100 * (s - 1):+.1f}" for s in shares)])
    return markdown_table(
        ("scene", "step without obstacle [ms]", "step with it [ms]", "increase of the median [%]", "of the sum [%]"),
        rows,
    )


if __name__ == "__main__":
    print(table())

# SPDX-License-Identifier: Apache-2.0
"""Group 7: long random walks of handles and actuators without drift, and without growth of memory and step time."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.scenes import read_scene
from benchmarks.torture.bodies import BAR, LAWS, distance, make_scene
from benchmarks.torture.case import Case, Finding, Group
from gdfe_ros.constraints import Pose
from gdfe_ros.results.step_result import StepResult
from gdfe_ros.scene.loader import scene_from_text
from gdfe_ros.scene.scene import Scene
from gdfe_ros.simulation import Command, Simulation
from gdfe_ros.solver.settings import Policy

STEPS = 100_000
"""Number of steps of the full walk."""
BOUND = 1e-6
"""Largest distance from the undeformed shape when every command is zero again, divided by the body's size."""
RETURN = 200
"""Number of steps of each path back to zero."""
PACE, PULL = 0.01, 0.001
"""Standard deviation of a step of the walk, and fraction by which each step moves the point towards zero."""
MOST_GROWTH = 5e6
"""Largest growth of the resident memory [B]."""
MOST_SLOWING = 1.1
"""Largest ratio of the last thousand steps to the first, for the processor time and for the iterations."""
WINDOW = 1000
FINGER = read_scene("two_cables.yaml")
BALL = read_scene("pressed_ball.yaml")
Drive = Callable[[NDArray[np.float64]], Command]


@dataclass(frozen=True)
class Track:
    """A scene, and a function from points of the cube [-1, 1]^k to commands; zero is the neutral command.

    Attributes:
        scene: function that returns the scene.
        width: dimension k of the cube.
        command: function from a point (k,) to a command.
    """

    scene: Callable[[], Scene]
    width: int
    command: Drive


def _handle(point: NDArray[np.float64]) -> Command:
    x, y, z, a, b, c = point.tolist()
    return Command({"tip": Pose((0.08 * x, 0.15 * y, 0.15 * z), (1.5 * a, 0.8 * b, 0.8 * c))})


TRACKS: dict[str, Track] = {
    "a bar's handle": Track(
        lambda: make_scene(BAR, LAWS["neo-hookean"], policy=Policy.ENERGY, tolerance=3e-7), 6, _handle
    ),
    "two cables": Track(
        lambda: scene_from_text(FINGER),
        2,
        lambda point: Command(actuators={"upper": 10.0 * abs(point[0]), "lower": 0.01 * point[1]}),
    ),
    "a pressed ball": Track(
        lambda: scene_from_text(BALL), 1, lambda point: Command(actuators={"air": 8e4 * abs(point[0])})
    ),
}


@dataclass(frozen=True)
class Walk:
    """Result of a walk.

    Attributes:
        last: result of the last step, with every command zero.
        unconverged: number of steps that did not converge.
        drift: largest final distance from the undeformed shape, divided by the body's size.
        growth: growth of the resident memory from the first thousand steps to the end [B].
        times: processor times of the first and of the last thousand steps, with the same commands [s].
        iterations: iterations of the same steps.
    """

    last: StepResult
    unconverged: int
    drift: float
    growth: float
    times: tuple[float, float]
    iterations: tuple[int, int]

    def flaws(self) -> list[str]:
        """Return a message for each defect of the walk, except for the drift."""
        found = []
        if self.unconverged:
            found.append(f"{self.unconverged} steps did not converge")
        if self.growth > MOST_GROWTH:
            found.append(f"memory grew by {self.growth / 1e6:.1f} MB")
        for what, (first, last) in (("seconds", self.times), ("iterations", self.iterations)):
            if last > MOST_SLOWING * first:
                found.append(f"a window took {first:.4g} {what} at first and {last:.4g} in the end")
        return found


class Walker:
    """A simulation, commanded by points of a track's cube.

    Attributes:
        simulation: the simulation.
        result: the last result.
        unconverged, iterations, seconds: sums over all steps so far.
    """

    def __init__(self, track: Track) -> None:
        self.simulation, self._track = Simulation(track.scene()), track
        self.unconverged = self.iterations = 0
        self.seconds = 0.0

    def step(self, point: NDArray[np.float64]) -> None:
        """Make a step with the command of a point."""
        command = self._track.command(point)
        started = time.thread_time()
        self.result = self.simulation.step(command)
        self.seconds += time.thread_time() - started
        self.unconverged += not self.result.converged
        self.iterations += self.result.iterations


def resident() -> float:
    """Return the resident memory of this process [B]."""
    gc.collect()
    return 4096.0 * int(Path("/proc/self/statm").read_text().split()[1])


def walk(track: Track, steps: int, *, seed: int = 1) -> Walk:
    """Walk at random, return to zero, repeat the first steps of the walk, and return to zero; ``steps`` steps in total.

    The first and the last thousand steps have the same commands and start from the undeformed shape. They are compared
    under equal load of the machine: a new simulation makes the first steps, in turn with the last steps of the old one.
    """
    walker, random = Walker(track), np.random.default_rng(seed)
    window, back = min(WINDOW, steps // 4), np.linspace(1.0, 0.0, min(RETURN, steps // 8) + 1)[1:]
    opening, point = [], np.zeros(track.width)
    for i in range(steps - window - 2 * len(back)):
        point = np.clip(point + random.normal(0.0, PACE, track.width) - PULL * point, -1.0, 1.0)
        walker.step(point)
        if i < window:
            opening.append(point)
        if i == window:
            begun = resident()
    for share in back:
        walker.step(share * point)
    growth, new, before = resident() - begun, Walker(track), (walker.seconds, walker.iterations)
    new.simulation.warm_up()
    for point in opening:
        new.step(point)
        walker.step(point)
    times = new.seconds, walker.seconds - before[0]
    iterations = new.iterations, walker.iterations - before[1]
    for share in back:
        walker.step(share * opening[-1])
    mesh = walker.simulation.mesh
    drift = distance(walker.result.positions, mesh.vertices, mesh.size)
    return Walk(walker.result, walker.unconverged, drift, growth, times, iterations)


def _run(track: Track, steps: int) -> Finding:
    found = walk(track, steps)
    return Finding((found.last,), found.drift, flaws=tuple(found.flaws()))


def cases(steps: int = STEPS) -> list[Case]:
    """Return the cases of the group, with walks of ``steps`` steps."""
    return [
        Case(
            group=Group.WALKS,
            name=name,
            policy=Policy.ENERGY,
            law="neo-hookean",
            run=partial(_run, track, steps),
            bound=BOUND,
        )
        for name, track in TRACKS.items()
    ]

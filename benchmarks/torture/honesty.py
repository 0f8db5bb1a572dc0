# SPDX-License-Identifier: Apache-2.0
"""Group 9: true error of every converged step, divided by the tolerance.

The true error is the distance from the same stream at a tolerance of 1e-8. If a body is so close to buckling that 1e-8
is below the precision of its energy, the tolerance is 1e-6. Steps that report that they have not converged are not
compared.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from benchmarks.scenes import read_scene
from benchmarks.torture.case import Case, Finding, Group
from benchmarks.torture.slender_bodies import FINGERS, SLENDER_BODIES, fork
from gdfe_ros.results.step_result import StepResult
from gdfe_ros.scene import Scene, load_scene, scene_from_text
from gdfe_ros.simulation import Command, Simulation
from gdfe_ros.solver.settings import Policy

TOLERANCES = (1e-3, 1e-4, 1e-5)
TRUTHS = (1e-8, 1e-6)
PROMISE = 1.0
"""Largest allowed true error of a converged step, divided by the tolerance."""
TEXT = read_scene("weighed_bar.yaml.in")
HELD = read_scene("held_bar.yaml.in")
TENDON = read_scene("tendon_bar.yaml.in")
RUBBER = "law: neo_hookean, young: 5.0e5, poisson: 0.499"


@dataclass(frozen=True)
class Stream:
    """A scene and its load path.

    Attributes:
        scene: function that returns the scene.
        steps: number of steps into which the load path is divided.
        played: number of these steps that are made.
    """

    scene: Callable[[], Scene]
    steps: int
    played: int


def bar(size: tuple[float, float, float], cells: tuple[int, int, int], sag: float, **options: object) -> Scene:
    """Return a clamped bar or plate whose sag according to beam theory is ``sag`` times its length."""
    length, _, thickness = size
    gravity = -sag * length * 8.0 * 1e6 * thickness**2 / (12.0 * 1000.0 * length**4)
    mesh = f"bar: {{size: {list(size)}, cells: {list(cells)}}}"
    words = {"poisson": 0.45, "hard": "", **options}
    return scene_from_text(TEXT.format(mesh=mesh, gravity=gravity, **words))


def held(
    length: float,
    cells: tuple[int, int, int],
    poisson: float,
    shift: tuple[float, float, float],
    turn: tuple[float, float, float],
) -> Scene:
    """Return a bar of ``length`` [m] with held ends; its tip moves by ``shift`` lengths and turns by ``turn`` [deg]."""
    given = {"shift": [length * part for part in shift], "turn": list(turn)}
    return scene_from_text(HELD.format(length=length, cells=list(cells), poisson=poisson, **given))


def tendon_bar(ratio: float, cells: tuple[int, int, int], law: str, command: str, value: float) -> Scene:
    """Return a clamped bar 0.01 m thick and ``ratio`` times as long, with a tendon beside its axis.

    The final command ``value`` is a shortening over the thickness, or a tension over 50 N.
    """
    length, thickness = 0.01 * ratio, 0.01
    points = [[share * length, side * thickness, 0.4 * thickness] for share, side in ((0, 0), (0.5, 0), (0.95, 0.2))]
    final = value * (thickness if command == "shortening" else 50.0)
    given = {"length": length, "thickness": thickness, "cells": list(cells), "law": law, "points": points}
    return scene_from_text(TENDON.format(**given, command=command, value=final))


LINKS = "".join(f", {{material: hard, where: {{box: {{x: [{x}, {x + 0.04}]}}}}}}" for x in (0.0, 0.06, 0.12))
LAYER = ", {material: hard, where: {box: {z: [-1, -0.0045]}}}"
FORKS = {
    "fork, right": (6.61e-05, 0.0032531, 0.003651),
    "fork, middle": (0.0030709, 0.0057028, 0.000865),
    "fork, left": (0.0057699, 0.0043487, 0.0032474),
    "fork, far right": (0.0016613, 0.0009639, 0.0058196),
}
"""Dict from name to the shortenings [m] of a fork's cables in one step."""
HELD_BARS = {
    "held bar 1:3, nu 0.49": (0.03, (9, 3, 3), 0.49, (0.1, 0.2, -0.1), (80.0, 40.0, 0.0)),
    "held bar 1:6, nu 0.49": (0.06, (12, 2, 2), 0.49, (0.1, -0.2, 0.1), (80.0, 40.0, 0.0)),
    "held bar 1:8": (0.08, (24, 3, 3), 0.3, (-0.1, 0.1, 0.2), (80.0, 40.0, 0.0)),
    "held bar 1:10": (0.1, (20, 2, 2), 0.45, (-0.1, 0.1, 0.3), (100.0, 50.0, 0.0)),
    "held bar 1:14": (0.14, (42, 3, 3), 0.45, (0.0, 0.0, 0.0), (90.0, 45.0, 0.0)),
}
"""Dict from name to arguments of `held`: stocky bars that are bent and turned far in one step."""
STOCKY = ("bend5", "twist90", "two_material_bar")
STREAMS: Mapping[str, Stream] = {
    "bar 1:10": Stream(partial(bar, (0.4, 0.04, 0.04), (40, 2, 2), 0.38), 50, 10),
    "bar 1:50": Stream(partial(bar, (0.4, 0.008, 0.008), (200, 2, 2), 0.38), 50, 6),
    "bar 1:100": Stream(partial(bar, (0.4, 0.004, 0.004), (400, 2, 2), 0.38), 50, 4),
    "bar 1:10, nu 0.495": Stream(partial(bar, (0.4, 0.04, 0.04), (40, 2, 2), 0.38, poisson=0.495), 50, 10),
    "bar 1:10 in one step": Stream(partial(bar, (0.4, 0.04, 0.04), (40, 2, 2), 0.38), 1, 1),
    "bar 1:50 in one step": Stream(partial(bar, (0.4, 0.008, 0.008), (200, 2, 2), 0.1), 1, 1),
    "plate 1:100": Stream(partial(bar, (0.1, 0.1, 0.001), (20, 20, 1), 0.65), 100, 5),
    "tendon bar 1:40, one cell across": Stream(
        partial(tendon_bar, 40.0, (20, 1, 1), "preset: dragon_skin_30", "shortening", 0.5), 3, 3
    ),
    "tendon bar 1:20, nu 0.499": Stream(partial(tendon_bar, 20.0, (30, 2, 2), RUBBER, "tension", 0.02), 10, 5),
    "hard links": Stream(partial(bar, (0.2, 0.02, 0.02), (40, 4, 4), 0.5, hard=LINKS), 50, 4),
    "hard layer": Stream(partial(bar, (0.2, 0.02, 0.02), (40, 4, 4), 5.0, hard=LAYER), 50, 4),
    **{
        name: Stream(partial(load_scene, name), 100, 6)
        for name in ("tendon_finger", "gripper", "bending_tube", "pneunet", "three_chamber_arm")
    },
    **{name: Stream(scene, 50, 5) for name, scene in SLENDER_BODIES.items()},
    **{
        f"{name} in one step": Stream(partial(fork, dict(zip(FINGERS, pulls, strict=True))), 1, 1)
        for name, pulls in FORKS.items()
    },
    **{f"{name}, in one step": Stream(partial(held, *given), 1, 1) for name, given in HELD_BARS.items()},
    **{name: Stream(partial(load_scene, name), 50, 6) for name in STOCKY},
    "plate 1:100, fine": Stream(partial(bar, (0.1, 0.1, 0.001), (100, 100, 1), 0.65), 100, 3),
}


@cache
def _truth(name: str) -> tuple[StepResult, ...]:
    """Return a stream's results at the first tolerance of `TRUTHS` at which all steps converge, or at the last one."""
    for tolerance in TRUTHS:
        results = played(STREAMS[name], tolerance)
        if all(result.converged for result in results):
            break
    return results


def played(stream: Stream, tolerance: float) -> tuple[StepResult, ...]:
    """Return the results of the steps of a stream with another tolerance."""
    scene = stream.scene()
    return play(Simulation(replace(scene, solver=replace(scene.solver, tolerance=tolerance))), stream)


def play(simulation: Simulation, stream: Stream) -> tuple[StepResult, ...]:
    """Make the steps of a stream, and return their results. Without a program, the weight increases in each step."""
    if simulation.scene.program is not None:
        return tuple(result for result, _ in zip(simulation.play(stream.steps), range(stream.played), strict=False))
    shares = np.arange(1, stream.played + 1) / stream.steps
    return tuple(simulation.step(Command(loads={"weight": float(share)})) for share in shares)


def error_of(found: StepResult, true: StepResult, size: float) -> float:
    """Return the largest distance of a vertex from its true position, divided by the body's ``size`` [m]."""
    distance: NDArray[np.float64] = np.linalg.norm(found.positions - true.positions, axis=1)
    return float(distance.max()) / size


def _run(name: str, tolerance: float) -> Finding:
    size, truth, results = STREAMS[name].scene().mesh.size, _truth(name), played(STREAMS[name], tolerance)
    pairs = [(found, true) for found, true in zip(results, truth, strict=True) if found.converged and true.converged]
    errors = [error_of(found, true, size) / tolerance for found, true in pairs]
    return Finding(results, max(errors, default=np.nan))


def cases() -> list[Case]:
    """Return the cases of the group about true errors."""
    return [
        Case(
            group=Group.HONESTY,
            name=f"{name}, tolerance {tolerance:g}",
            policy=Policy.ENERGY,
            law="as it is",
            run=partial(_run, name, tolerance),
            bound=PROMISE,
            may_report=True,
        )
        for name in STREAMS
        for tolerance in TOLERANCES
    ]

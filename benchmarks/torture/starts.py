# SPDX-License-Identifier: Apache-2.0
"""Group 1: the equilibrium must be found from arbitrary, even meaningless vertex positions."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from benchmarks.torture.bodies import BAR, LAWS, Driver, distance, laws_for, make_scene
from benchmarks.torture.case import Case, Finding, Group
from gdfe_ros.constraints import Pose
from gdfe_ros.mesh import HexMesh, bar
from gdfe_ros.solver.settings import Policy

BOUND = 1e-6
TOLERANCE = 1e-8
LENGTH = 0.4
FINE = bar([0.4, 0.1, 0.1], [16, 4, 4])
"""A mesh that is too large for the explicit inverse; its constant matrix has a sparse factor."""
FINE_LAWS = {
    "linear": Policy.RELATIVE,
    "neo-hookean": Policy.ENERGY,
    "curve": Policy.ENERGY,
    "ogden, nu 0.495": Policy.ENERGY,
}
FINE_STARTS = ("random in a box", "all in one point", "many inverted elements", "mirrored")
POSE = Pose(translation=(0.02, 0.0, 0.08), rotation=(0.3, 0.0, 0.0))
Array = NDArray[np.float64]


def _mirrored(x: Array) -> Array:
    return x * (1.0, -1.0, 1.0)


def _one_inverted(x: Array) -> Array:
    start = x.copy()
    corners = BAR.cells[13]
    start[corners[[0, 6]]] = x[corners[[6, 0]]]
    return start


STARTS: dict[str, Callable[[Array], Array]] = {
    "random in a box": lambda x: np.random.default_rng(1).uniform(x.min(axis=0), x.max(axis=0), x.shape),
    "random in a box 100 times as wide": lambda x: np.random.default_rng(2).uniform(-20.0, 20.0, x.shape),
    "all in one point": lambda x: np.tile(x.mean(axis=0), (len(x), 1)),
    "flattened to a plane": lambda x: x * (1.0, 1.0, 0.0),
    "flattened to a line": lambda x: x * (1.0, 0.0, 0.0),
    "mirrored": _mirrored,
    "one inverted element": _one_inverted,
    "many inverted elements": lambda x: x + np.random.default_rng(3).normal(0.0, 0.06, x.shape),
    "turned inside out and off": lambda x: 5.0 - 2.0 * x,
}


def _run(start: Callable[[Array], Array], law: str, policy: Policy, mesh: HexMesh = BAR) -> Finding:
    scene = make_scene(mesh, LAWS[law], policy=policy, tolerance=TOLERANCE)
    expected = Driver(scene).step(POSE).positions
    driver = Driver(scene)
    driver.follow(POSE, 1)
    driver.simulation.set_positions(start(expected))
    result = driver.step()
    return Finding(tuple(driver.results), distance(result.positions, expected, LENGTH), driver.rise)


def cases() -> list[Case]:
    """Return the cases of the group with arbitrary initial positions."""
    case = partial(Case, group=Group.STARTS, bound=BOUND)
    found = [
        case(name=name, policy=policy, law=law, run=partial(_run, start, law, policy))
        for policy in Policy
        for name, start in STARTS.items()
        for law in laws_for(policy)
    ]
    for name in FINE_STARTS:
        for law, policy in FINE_LAWS.items():
            run = partial(_run, STARTS[name], law, policy, FINE)
            found.append(case(name=f"fine mesh: {name}", policy=policy, law=law, run=run))
    return found

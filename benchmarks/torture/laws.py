# SPDX-License-Identifier: Apache-2.0
"""Group 6: laws that soften, kink, decrease or are unstable are reported before the solve; bodies stay sound."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from benchmarks.torture.bodies import BAR, Driver, distance, make_scene
from benchmarks.torture.case import Case, Finding, Group
from gdfe_ros.constraints import Pose
from gdfe_ros.materials import Curve, CurveData, Law, Material, Ogden, preset
from gdfe_ros.solver.settings import Policy

LENGTH = 0.4
PULL = Pose(translation=(0.3, 0.0, 0.0))
FAR = Pose(translation=(0.32, 0.0, 0.0))
PUSH = Pose(translation=(-0.08, 0.0, 0.0))
STEPS = 30


def _table(strain: list[float], stress: list[float], poisson: float = 0.45) -> Material:
    return Curve(data=CurveData.table(strain, stress), poisson=poisson)


def _polynomial(*coefficients: float, strain_max: float | None = None) -> Material:
    return Curve(data=CurveData.polynomial(coefficients, strain_max=strain_max), poisson=0.45)


def _ogden(mu: tuple[float, ...], alpha: tuple[float, ...], poisson: float = 0.45) -> Material:
    return Ogden(mu=mu, alpha=alpha, poisson=poisson)


SOUND: dict[str, tuple[Callable[[], Material], Pose]] = {
    "softens": (lambda: _table([0.1, 0.3, 1.0, 2.0], [2e4, 4e4, 7e4, 1e5]), PULL),
    "kinks to a hundredth": (lambda: _table([0.2, 0.21, 2.0], [2e4, 2.01e4, 3.8e4]), PULL),
    "kinks to a hundredfold": (lambda: _table([0.2, 0.21, 2.0], [2e3, 2.1e3, 1.5e5]), PULL),
    "measured to a strain of 0.2": (lambda: _table([0.1, 0.2], [1e4, 1.9e4]), FAR),
}
"""Laws with a unique equilibrium: a slow load path and a single step must reach the same state."""
DOUBTFUL: dict[str, tuple[Callable[[], Material], Pose, str]] = {
    "dips and recovers": (lambda: _table([0.1, 0.2, 0.4, 1.0], [1e4, 2.2e4, 1.8e4, 6e4]), PULL, "tangent modulus"),
    "falls to the end": (lambda: _table([0.2, 0.5, 1.0], [2e4, 1.5e4, 1e4]), PULL, "tangent modulus is negative"),
    "falls below zero": (lambda: _table([0.2, 0.5, 1.0], [2e4, 1e3, -1e4]), PULL, "stress is not positive"),
    "polynomial that turns back": (
        lambda: _polynomial(1e5, -2e5, 1e5, strain_max=1.0), PULL, "tangent modulus is negative",
    ),
}  # fmt: skip
UNSTABLE: dict[str, tuple[Callable[[], Material], Pose, str]] = {
    "cheetah in compression": (
        lambda: preset("cheetah", law=Law.OGDEN, poisson=0.49), PUSH, "unstable in uniaxial compression",
    ),
    "negative term": (lambda: _ogden((-1e5, 2e5), (2.0, 1.0)), PULL, "unstable in"),
    "steep negative exponent": (lambda: _ogden((3e5, -1e5), (-1.0, -8.0)), PUSH, "unstable in"),
    "steep positive exponent": (lambda: _ogden((3e5, -1e5), (1.0, 8.0)), PULL, "unstable in"),
}  # fmt: skip


def _sound(make: Callable[[], Material], pose: Pose, policy: Policy) -> Finding:
    scene = make_scene(BAR, make(), policy=policy)
    expected = Driver(scene).follow(pose, STEPS)
    driver = Driver(scene)
    result = driver.step(pose)
    error = distance(result.positions, expected.positions, LENGTH)
    return Finding(tuple(driver.results), error, driver.rise, tuple(driver.simulation.remarks()))


def _doubtful(make: Callable[[], Material], pose: Pose, policy: Policy) -> Finding:
    driver = Driver(make_scene(BAR, make(), policy=policy))
    driver.step(Pose(tuple(0.5 * value for value in pose.translation)))
    driver.step(pose)
    return Finding(tuple(driver.results), np.nan, driver.rise, tuple(driver.simulation.remarks()))


def cases() -> list[Case]:
    """Return the cases of the group with unusual laws."""
    found = []
    for policy in Policy:
        case = partial(Case, group=Group.LAWS, policy=policy)
        for name, (make, pose) in SOUND.items():
            bound = 1e-4 if policy is Policy.ENERGY else 0.1
            found.append(case(name=name, law="curve", run=partial(_sound, make, pose, policy), bound=bound))
        laws = {"curve": DOUBTFUL, "ogden": UNSTABLE}
        for law, (name, (make, pose, words)) in ((law, item) for law, group in laws.items() for item in group.items()):
            run = partial(_doubtful, make, pose, policy)
            found.append(case(name=name, law=law, run=run, bound=np.inf, remark=words, may_report=True))
    return found

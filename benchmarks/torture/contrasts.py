# SPDX-License-Identifier: Apache-2.0
"""Group 3: contrasts of stiffness, and nearly incompressible bodies. Energies are compared, not only positions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from benchmarks.torture.bodies import BAR, Driver, distance, make_scene
from benchmarks.torture.case import Case, Finding, Group
from gdfe_ros.constraints import Pose
from gdfe_ros.materials import Curve, CurveData, Law, Linear, Material, NeoHookean, preset
from gdfe_ros.mesh import HexMesh
from gdfe_ros.mesh.generators import grid
from gdfe_ros.solver.settings import Policy

DEFAULT = 1e-4
"""Tested tolerance: the default tolerance of scenes."""
TIGHT = 1e-7
POSE = Pose(translation=(0.04, 0.0, 0.03))
PULL = 0.004
LENGTH = 0.4
CENTROIDS = BAR.centroids
PATTERNS: dict[str, NDArray[np.int32]] = {
    "halves": (CENTROIDS[:, 0] > 0.2).astype(np.int32),
    "one hard layer": ((CENTROIDS[:, 0] > 0.15) & (CENTROIDS[:, 0] < 0.2)).astype(np.int32),
    "one soft layer": 1 - ((CENTROIDS[:, 0] > 0.15) & (CENTROIDS[:, 0] < 0.2)).astype(np.int32),
    "skin along the bar": (CENTROIDS[:, 2] > 0.0).astype(np.int32),
    "checkerboard": (np.round(CENTROIDS / 0.05 + 1e-6).astype(np.int64).sum(axis=1) % 2).astype(np.int32),
}


def _linear(young: float, poisson: float) -> Material:
    return Linear(young=young, poisson=poisson)


def _neo_hookean(young: float, poisson: float) -> Material:
    return NeoHookean(young=young, poisson=poisson)


def _curve(young: float, poisson: float) -> Material:
    return Curve(data=CurveData.table([0.1, 0.4, 1.0, 2.0], np.multiply([0.1, 0.25, 0.6, 1.4], young)), poisson=poisson)


def _ogden(_: float, poisson: float) -> Material:
    return preset("cheetah", law=Law.OGDEN, poisson=poisson)


MAKERS: dict[str, Callable[[float, float], Material]] = {
    "linear": _linear,
    "neo-hookean": _neo_hookean,
    "curve": _curve,
    "ogden": _ogden,
}


def _energy_error(
    materials: Material | Sequence[Material], cells: NDArray[np.int32] | None = None, mesh: HexMesh = BAR
) -> Finding:
    """Return the relative error of the energy at the default tolerance, compared with a much smaller tolerance."""
    exact, driver = (
        Driver(make_scene(mesh, materials, policy=Policy.ENERGY, tolerance=tolerance, cell_material=cells,
                          max_iterations=50000))
        for tolerance in (TIGHT, DEFAULT)
    )  # fmt: skip
    expected, result = exact.step(POSE), driver.step(POSE)
    return Finding((expected, result), abs(result.energy - expected.energy) / expected.energy, driver.rise)


def _contrast(pattern: str, law: str, ratio: float) -> Finding:
    return _energy_error([MAKERS[law](1e4, 0.3), MAKERS[law](1e4 * ratio, 0.3)], PATTERNS[pattern])


def _series(ratio: float, young: float = 1e4) -> Finding:
    """Return the error of two springs in series (nu = 0) against the closed form: position of the joint, and energy."""
    materials = [_linear(young, 0.0), _linear(young * ratio, 0.0)]
    scene = make_scene(BAR, materials, policy=Policy.ENERGY, tolerance=DEFAULT, cell_material=PATTERNS["halves"])
    driver = Driver(scene)
    result = driver.step(Pose(translation=(PULL, 0.0, 0.0)))
    soft = PULL * ratio / (1.0 + ratio)
    joint = result.positions[np.abs(BAR.vertices[:, 0] - 0.2) < 1e-9, 0].mean()
    # P = E/(1+nu) (F - lam R) + K (F - 1) with nu = 0, K = E/3: exactly E (l - 1) along the bar
    energy = 0.5 * 0.01 / 0.2 * young * (soft**2 + ratio * (PULL - soft) ** 2)
    error = max(abs(joint - 0.2 - soft) / LENGTH, abs(result.energy - energy) / energy)
    return Finding(tuple(driver.results), error, driver.rise)


def _relative_contrast(pattern: str, ratio: float) -> Finding:
    """Return the error of the shape at the default tolerance, compared with a much smaller tolerance."""
    materials = [_linear(1e4, 0.3), _linear(1e4 * ratio, 0.3)]

    exact, driver = (
        Driver(make_scene(BAR, materials, policy=Policy.RELATIVE, tolerance=each, cell_material=PATTERNS[pattern]))
        for each in (1e-8, DEFAULT)
    )
    expected, result = exact.step(POSE), driver.step(POSE)
    error = distance(result.positions, expected.positions, LENGTH)
    return Finding((expected, result), error, remarks=tuple(driver.simulation.remarks()))


def _sandwich() -> Finding:
    """Return the energy error of a core with a skin that has 1/100 of a cell's height and 1000 times the modulus."""
    mesh = grid(np.linspace(0.0, 0.4, 17), np.linspace(-0.05, 0.05, 3), [-0.05, 0.0, 0.05, 0.0505])
    cells = (mesh.centroids[:, 2] > 0.05).astype(np.int32)
    return _energy_error([_neo_hookean(1e4, 0.45), _linear(1e7, 0.3)], cells, mesh)


def _lumps(ratio: float) -> Finding:
    """Return the energy error of a soft, nearly incompressible bar with hard inclusions."""
    lumps = np.isin(np.arange(BAR.n_cells) % 8, (2, 5)).astype(np.int32)
    return _energy_error([_neo_hookean(1e4, 0.495), _neo_hookean(1e4 * ratio, 0.3)], lumps)


def cases() -> list[Case]:
    """Return the cases of the group with contrasts."""
    energy = partial(Case, group=Group.CONTRASTS, policy=Policy.ENERGY)
    relative = partial(Case, group=Group.CONTRASTS, policy=Policy.RELATIVE)
    found = []
    for ratio in (1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6):
        label = f"1 to {ratio:g}"
        found.append(energy(name=f"springs in series, {label}", law="linear", run=partial(_series, ratio), bound=1e-3))
    for pattern in PATTERNS:
        for ratio, law in ((1e2, "neo-hookean"), (1e6, "linear"), (1e6, "neo-hookean"), (1e4, "curve")):
            run = partial(_contrast, pattern, law, ratio)
            found.append(energy(name=f"{pattern}, 1 to {ratio:g}", law=law, run=run, bound=1e-3))
    found.append(energy(name="skin of 1/100, 1 to 1000", law="mixed", run=_sandwich, bound=1e-3))
    found += [
        energy(name=f"lumps, 1 to {ratio:g}", law="neo-hookean, nu 0.495", run=partial(_lumps, ratio), bound=1e-3)
        for ratio in (1e3, 1e6)
    ]
    for law in MAKERS:
        for poisson in (0.0, 0.3, 0.45, 0.49, 0.499, 0.4999, 0.5):
            name = f"nu {poisson:g}" if poisson < 0.5 else "incompressible"
            found.append(energy(name=name, law=law, run=partial(_energy_error, MAKERS[law](1e5, poisson)), bound=1e-3))
    run = partial(_series, 1e11, 10.0)
    found.append(
        energy(name="springs in series, 1 to 1e+11", law="linear", run=run, bound=0.0, refusal="times as stiff at rest")
    )
    for pattern in ("halves", "checkerboard"):
        for ratio in (1.0, 2.0, 5.0, 10.0, 30.0, 60.0):
            run = partial(_relative_contrast, pattern, ratio)
            found.append(relative(name=f"{pattern}, 1 to {ratio:g}", law="linear", run=run, bound=1e-3))
        for ratio in (1e3, 1e6):
            run = partial(_relative_contrast, pattern, ratio)
            name = f"{pattern}, 1 to {ratio:g}"
            found.append(relative(name=name, law="linear", run=run, bound=np.inf, remark="beyond the calibration"))
    return found

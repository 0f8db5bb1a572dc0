# SPDX-License-Identifier: Apache-2.0
"""Exact derivatives of bodies of quadratic tetrahedra against central differences."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gdfe_ros import Command, Pose
from gdfe_ros.mesh import bar
from gdfe_ros.mesh.assembly import keep_cells
from gdfe_ros.mesh.files.stored_mesh import pack_mesh
from gdfe_ros.mesh.tetmesh import divide
from test.solver.sensitivity.test_equilibrium import BAR, TIP, command_error, worst_error
from test.solver.sensitivity.test_motion import CASES, motion_error

MESH = {"embedded": pack_mesh(divide(bar([0.1, 0.03, 0.03], [5, 1, 1])))}
CABLE = "{cable: {points: [[0, 0, 0.012], [0.05, 0.003, 0.012], [0.098, 0, 0.012]], command: shortening}}"
GROWTH = "{growth: {stretch: [1.2, 1, 0.95], where: {box: {x: [0, 0.061]}}}}"


def _material(key: str, value: float) -> Any:
    return lambda change: (Command(), {f"materials__soft__{key}": value + change})


@pytest.mark.parametrize(
    ("key", "value", "step"),
    [("young", 1e5, 1e3), ("poisson", 0.45, 1e-4), ("poisson", 0.495, 1.5e-4), ("density", 1100.0, 11.0)],
)
def test_materials(key: str, value: float, step: float) -> None:
    """Derivatives with respect to moduli, Poisson's ratios with and without pressures, and densities."""
    beside = _material(key, value)
    given = {**beside(0.0)[1], "solver__tolerance": 1e-10}
    name = f"materials.soft.{key}"
    assert worst_error(BAR, Command(), name, beside, step, mesh=MESH, **given) <= 1.0


@pytest.mark.parametrize(("kind", "value", "step"), [(CABLE, 0.004, 1e-4), (GROWTH, 0.5, 1e-2)])
def test_actuators(kind: str, value: float, step: float) -> None:
    """Derivatives with respect to the shortening of a cable and the fraction of a growth."""
    assert command_error(kind, value, step, mesh=MESH) <= 1.0


def test_a_chamber_of_given_pressure() -> None:
    """Derivatives with respect to the pressure in a cavity, whose faces have six nodes."""
    block = keep_cells(bar([0.1, 0.03, 0.03], [5, 3, 3]), np.arange(45) != 22)
    kind, mesh = "{chamber: {cavity: 0, command: pressure}}", {"embedded": pack_mesh(divide(block))}
    assert command_error(kind, 4000.0, 40.0, mesh=mesh) <= 1.0


def test_poses() -> None:
    """Derivatives with respect to the rotation of a handle that slides."""

    def posed(change: float) -> tuple[Command, dict[str, Any]]:
        return Command(handles={"tip": Pose((-0.006, 0.004, 0.0), (0.1 + change, -0.2, 0.3))}), {}

    assert worst_error(BAR, posed(0.0)[0], "handles.tip.rx", posed, 5e-3, mesh=MESH, **TIP["free"]) <= 1.0


@pytest.mark.parametrize("case", ["modulus", "volume", "tension", "viscosity", "relaxation"])
def test_motions(case: str) -> None:
    """Derivatives along a motion: modulus, Poisson's ratio with pressures, tension, viscosity, relaxation."""
    name, beside, step, given = CASES[case]
    if case == "volume":  # farther apart than the errors of solves with pressures
        step, given = 3.0 * step, {**given, "solver.tolerance": 1e-10}
    assert motion_error((name, beside, step, {**given, "mesh": MESH})) <= 1.0

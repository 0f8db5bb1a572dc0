# SPDX-License-Identifier: Apache-2.0
"""A clamped bar under its weight: quadratic tetrahedra show neither locking nor hourglassing."""

from __future__ import annotations

import re

import numpy as np
import pytest

from gdfe_ros import Simulation
from gdfe_ros.actuators import Gravity
from gdfe_ros.constraints import Handle
from gdfe_ros.materials import Material, NeoHookean, Ogden
from gdfe_ros.mesh import Mesh, bar
from gdfe_ros.mesh.inspection import inspect_mesh
from gdfe_ros.mesh.tetmesh import divide
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.equilibrium.energy import EquilibriumSolver
from gdfe_ros.solver.forces.actuation import Actuation
from gdfe_ros.solver.solution import Increment
from test.written import scene_of

SAGGING = """
materials: {m: {law: neo_hookean, young: 2.0e5, poisson: 0.45, density: 1000}}
handles: {base: {where: {face: x-}, fixed: true}}
loads: {weight: {gravity: [0, 0, -9.81]}}
probes: {tip: [0.1, 0.0, 0.0]}
solver: {tolerance: 1.0e-5}
"""
CONVERGED = {0.45: 18.0e-3, 0.4999: 17.8e-3}
"""Dict from Poisson's ratio to the tip's sag [m] on fine meshes of tetrahedra and hexahedra (at 20 cells across)."""


def sag(mesh: Mesh, law: Material) -> float:
    """Return the mean sag [m] of the end of a bar of 1000 kg/m^3, along x, that is clamped at its smallest x."""
    end = mesh.vertices[:, 0].max()
    held = np.flatnonzero(mesh.vertices[:, 0] < 1e-9).astype(np.int32)
    handles = [Handle("base", held, fixed=True)]
    body = Body.build(mesh.vertices, mesh.cells, [law], np.zeros(mesh.n_cells, np.int32), handles)
    weight, density = np.array([0.0, 0.0, -9.81]), np.full(mesh.n_cells, 1000.0)
    load = Gravity(name="weight", acceleration=weight, density=density)
    equilibrium = EquilibriumSolver(body, Actuation(body, (), [load]))
    rest = equilibrium.at_rest()
    step = Increment(poses=rest.poses, commands={"weight": 1.0}, tolerance=1e-5, limit=5000)
    found = equilibrium.solve(step, rest)
    assert found.converged, found.state.summary.message
    return float((mesh.vertices - found.positions)[mesh.vertices[:, 0] > end - 1e-9, 2].mean())


@pytest.mark.parametrize("poisson", CONVERGED)
def test_a_clamped_bar_sags_within_one_per_cent(poisson: float) -> None:
    """With 10 x 2 x 2 cubes of six tetrahedra the sag is within 1 %; linear ones give a third or a tenth of the sag."""
    found = sag(divide(bar([0.1, 0.02, 0.02], [10, 2, 2])), NeoHookean(young=2e5, poisson=poisson))
    assert found == pytest.approx(CONVERGED[poisson], rel=0.01)


@pytest.mark.parametrize(
    "law",
    [NeoHookean(young=2e5, poisson=0.4999), Ogden(mu=(2e5 / 3.0,), alpha=(2.0,), poisson=0.4999)],
    ids=["neo-hookean", "ogden"],
)
def test_the_sag_converges_with_the_mesh(law: Material) -> None:
    """The sag is within 0.5 % of that of the next finer mesh, and converges, also for laws of isochoric strain."""
    sags = [sag(divide(bar([0.1, 0.02, 0.02], cells)), law) for cells in ([5, 1, 1], [10, 2, 2], [20, 4, 4])]
    assert sags[1] == pytest.approx(sags[2], rel=0.005)
    assert abs(sags[1] - sags[2]) < abs(sags[0] - sags[2])


def test_the_hexahedra_that_an_inspection_names_have_the_error_that_it_states() -> None:
    """The remark on a box of tetrahedra names hexahedra that sag by 1.4 % less than fine meshes, as it says."""
    (note,) = inspect_mesh(divide(bar([0.1, 0.02, 0.02], [15, 3, 3]))).remarks
    assert "about 5 times less than with 810 tetrahedra" in note
    (named,) = re.findall(r"`(mesh: .*?)`", note)
    simulation = Simulation(scene_of(named + SAGGING))
    assert simulation.mesh.n_cells == 320
    tip = simulation.probe_positions()["tip"][2]
    assert simulation.step().converged
    assert tip - simulation.probe_positions()["tip"][2] == pytest.approx(0.986 * CONVERGED[0.45], rel=0.002)
    assert "1.4 % too stiff" in note

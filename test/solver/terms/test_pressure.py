# SPDX-License-Identifier: Apache-2.0
"""Follower pressures on faces with open edges: forces, closed forms, derivatives, energies."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_bvp
from scipy.optimize import brentq

from gdfe_ros import Command, Simulation
from gdfe_ros.actuators.load import PressureLoad
from gdfe_ros.errors import SceneError
from gdfe_ros.materials import NeoHookean
from gdfe_ros.mesh import Mesh, bar
from gdfe_ros.mesh.cells.faces import reverse
from gdfe_ros.mesh.tetmesh import divide
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.terms.applied_load import PressureTerm
from gdfe_ros.solver.terms.term import TermTable
from test.differences import assert_derivative, assert_tangent, force_of
from test.written import advance, scene_of

HEAD = """
materials: {m: {law: neo_hookean, young: 1.0e6, poisson: 0.0, density: 1000}}
solver: {tolerance: 1.0e-7}
"""
STRIP = (
    HEAD
    + """
mesh: {bar: {size: [0.1, 0.01, 0.005], cells: [20, 1, 2]}}
handles: {base: {where: {face: x-}}}
loads: {p: {pressure: {where: {face: z+}, pressure: 200.0}}}
probes: {tip: [0.1, 0, 0]}
"""
)
LENGTH, WIDTH, THICKNESS = 0.1, 0.01, 0.005


def _elastica(pressure: float) -> np.ndarray:
    """Return the tip (x, z) [m] of an inextensible cantilever under a pressure on its upper side.

    At the arc length s, the tangent is (cos a, sin a), and the internal force is (N, Q) along the tangent and the
    normal. The upper side is longer than the axis by the factor 1 - a' t / 2.
    """
    bending = 1e6 * WIDTH * THICKNESS**3 / 12.0

    def slopes(s: np.ndarray, y: np.ndarray) -> np.ndarray:
        a, curvature, axial, shear = y[2:]
        load = -pressure * WIDTH * (1.0 - 0.5 * THICKNESS * curvature)
        bent = -shear / bending
        return np.array([np.cos(a), np.sin(a), curvature, bent, curvature * shear, -curvature * axial - load])

    def ends(first: np.ndarray, last: np.ndarray) -> np.ndarray:
        return np.array([*first[:3], *last[3:]])

    s, found = np.linspace(0.0, LENGTH, 60), np.zeros((6, 60))
    found[0] = s
    for share in np.linspace(0.1, 1.0, 10):
        full, pressure = pressure, share * pressure
        answer = solve_bvp(slopes, ends, s, found, tol=1e-6, max_nodes=20000)
        pressure = full
        assert answer.success
        found = answer.sol(s)
    return answer.y[:2, -1]


def test_a_strip_curls_as_the_elastica_under_a_follower_pressure() -> None:
    """The tip of a cantilever that turns by more than 90 degrees is the elastica's; the base bears the pressure."""
    simulation = Simulation(scene_of(STRIP))
    for factor in (0.125, 0.25, 0.375, 0.5, 0.625):
        result = advance(simulation, Command(loads={"p": factor}))
        tip, expected = simulation.probe_positions()["tip"], _elastica(200.0 * factor)
        np.testing.assert_allclose(tip[[0, 2]], expected, atol=0.015 * LENGTH)
        corners = result.positions[simulation.scene.loads[0].quads]
        pushed = 0.5 * np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]).sum(axis=0)
        np.testing.assert_allclose(result.reactions["base"][:3], -200.0 * factor * pushed, atol=1e-7)
    assert tip[0] < 0.2 * LENGTH
    assert result.stable is None


BLOCK = (
    HEAD.replace("poisson: 0.0", "poisson: 0.4")
    + """
mesh: {bar: {size: [0.04, 0.02, 0.02], cells: [2, 2, 2]}}
handles:
  mx: {where: {face: x-}, slide: [y, z]}
  my: {where: {face: y-}, slide: [x, z]}
  mz: {where: {face: z-}, slide: [x, y]}
loads: {p: {pressure: {where: {any: [{face: x+}, {face: y+}, {face: z+}]}, pressure: 4.0e5}}}
"""
)


@pytest.mark.parametrize("factor", [1.0, -0.5])
def test_a_block_under_pressure_on_three_faces_shrinks_evenly(factor: float) -> None:
    """Beside three planes of symmetry, a pressed block has the stretch of the hydrostatic closed form."""
    simulation = Simulation(scene_of(BLOCK))
    result = advance(simulation, Command(loads={"p": factor}))
    mu, lame, pressure = 1e6 / 2.8, 1e6 * 0.4 / (1.4 * 0.2), 4e5 * factor
    stretch = brentq(lambda a: (mu * (a**2 - 1) + lame * np.log(a**3)) / a**3 + pressure, 0.5, 2.0)
    corner = np.array([0.0, -0.01, -0.01])
    np.testing.assert_allclose(result.positions, corner + stretch * (simulation.mesh.vertices - corner), atol=1e-8)
    assert result.reactions["mx"][0] == pytest.approx(pressure * (0.02 * stretch) ** 2, rel=1e-6)


@pytest.mark.parametrize("mesh", [bar([0.04, 0.02, 0.02], [2, 1, 1]), divide(bar([0.04, 0.02, 0.02], [2, 1, 1]))])
def test_forces_are_the_gradient_of_the_energy(mesh: Mesh) -> None:
    """On closed and open surfaces, of hexahedra and tetrahedra, forces and tangents agree with differences."""
    material = NeoHookean(young=1e6, poisson=0.3)
    body = Body.build(mesh.vertices, mesh.cells, (material,), np.zeros(mesh.n_cells, np.int32), ())
    boundary = mesh.boundary.quads
    moved = body.rest + 1e-3 * np.random.default_rng(1).standard_normal(body.rest.shape)
    for faces, closed in ((boundary, True), (boundary[: len(boundary) // 3], False)):
        term = PressureTerm(PressureLoad(name="p", quads=reverse(faces), pressure=1.0), body)
        term.set_targets({}, None)
        term.begin({"p": 1.0}, term.neutral(), moved, 0.0)
        forces = term._sum_forces(moved, 0.0, 1.0)
        np.testing.assert_allclose(-force_of(moved, TermTable.of(term)), forces, atol=1e-15)
        assert (len(term.multipliers) == 0) == closed
        assert_derivative(TermTable.of(term), moved)  # with constant forces at open edges
        assert_tangent(term, moved)


def test_derivatives_agree_with_differences() -> None:
    """With forces that have no potential, derivatives by the factor and by the modulus agree with differences."""
    simulation = Simulation(scene_of(STRIP))
    simulation.step(Command(loads={"p": 0.2}))

    def tip(factor: float) -> np.ndarray:
        assert simulation.step(Command(loads={"p": factor})).converged
        return simulation.probe_positions()["tip"].copy()

    expected = (tip(0.302) - tip(0.298)) / 0.004
    tip(0.3)
    found = simulation.sensitivities(["probes.tip"], ["loads.p", "materials.m.young"])
    np.testing.assert_allclose(found.of("probes.tip", "loads.p"), expected, atol=1e-4 * np.abs(expected).max())
    # Only the ratio of pressure and modulus matters.
    by_modulus = found.of("probes.tip", "materials.m.young") * 1e6
    np.testing.assert_allclose(by_modulus, -0.3 * found.of("probes.tip", "loads.p"), atol=1e-6)


@pytest.mark.parametrize("scheme", ["bdf2", "newmark", "generalised_alpha"])
def test_the_energy_of_a_motion_is_accounted_for(scheme: str) -> None:
    """A strip that a pressure on its open face swings about its equilibrium: energies balance."""
    still = Simulation(scene_of(STRIP))
    still.step(Command(loads={"p": 0.1}))
    moving = Simulation(scene_of(f"{STRIP}dynamics: {{step: 0.002, scheme: {scheme}}}\n"))
    heights = []
    for _ in range(120):
        result = advance(moving, Command(loads={"p": 0.1}), dt=0.002)
        heights.append(moving.probe_positions()["tip"][2])
    energies = result.energies
    left = sum(energies[name] for name in ("kinetic", "elastic", "potential", "dissipated")) - energies["work"]
    allowed = 0.02 if scheme == "newmark" else 0.4
    assert abs(left) < allowed * max(energies["elastic"], 1e-9) + 1e-7
    assert min(heights) < still.probe_positions()["tip"][2] < max(heights)


def test_cut_cells_and_missing_faces_are_refused() -> None:
    """Faces that are not there are told with the mesh's extent."""
    with pytest.raises(SceneError, match="no boundary face is there"):
        scene_of(STRIP.replace("where: {face: z+}", "where: {box: {x: [1, 2]}}"))

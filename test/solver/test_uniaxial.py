# SPDX-License-Identifier: Apache-2.0
"""Uniaxial tension of a block with free lateral contraction: the solution against each law's closed form."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from gdfe_ros.constraints import Axis, Handle
from gdfe_ros.materials import Curve, CurveData, Law, Linear, Material, NeoHookean, preset
from gdfe_ros.mesh import HexMesh, bar
from gdfe_ros.results.element_fields import element_fields, strain_energies
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.equilibrium.energy import EquilibriumSolver
from test.materials.formulas import energy_density
from test.solver.conftest import solve

MakeBody = Callable[..., Body]
SIDE = 0.1
TABLE = CurveData.table([0.1, 0.4, 1.0, 2.0], [1.6e5, 4.0e5, 6.4e5, 11.9e5])
POLYNOMIAL = CurveData.polynomial([8.67e6, -15.7e6, 15.02e6, -6.91e6, 1.53e6, -0.13e6], strain_max=2.0)
KINDS: dict[str, Callable[[float], Material]] = {
    "linear": lambda nu: Linear(young=1e5, poisson=nu),
    "neo-hookean": lambda nu: NeoHookean(young=1e5, poisson=nu),
    "ogden": lambda nu: preset("cheetah", law=Law.OGDEN, poisson=nu),
    "curve-polynomial": lambda nu: Curve(data=POLYNOMIAL, poisson=nu),
    "curve-table": lambda nu: Curve(data=TABLE, poisson=nu),
}


def closed_form(material: Material, stretch: float) -> tuple[float, float]:
    """Return the lateral stretch without lateral traction and the energy density there."""
    guess = stretch**-0.5
    found = minimize_scalar(
        lambda lateral: energy_density(material, [stretch, lateral, lateral]),
        bounds=(0.6 * guess, 1.4 * guess),
        method="bounded",
        options={"xatol": 1e-9},
    )
    return float(found.x), float(found.fun)


def held_by_its_ends(mesh: HexMesh) -> list[Handle]:
    """Give each vertex of the two ends a handle that is free in y and z, except where it prevents rigid motion."""
    x, y, z = mesh.vertices.T
    handles = []
    for vertex in np.flatnonzero((x == 0.0) | (x == SIDE)):
        free = [Axis.Y] if abs(y[vertex]) > 1e-9 or x[vertex] > 0.0 else []
        if not (x[vertex] == 0.0 and abs(z[vertex]) < 1e-9):
            free.append(Axis.Z)
        handles.append(Handle(f"v{vertex}", np.array([vertex], dtype=np.int32), free=tuple(free)))
    return handles


@pytest.mark.parametrize("poisson", [0.45, 0.495, 0.4999])
def test_a_uniform_state_that_is_a_saddle_is_left(make_body: MakeBody, poisson: float) -> None:
    """An Ogden block pressed by a fifth leaves the uniform state, which is a saddle, for one of less energy.

    The uniform state is an equilibrium, but coarse cells of this law have less energy when the ends flatten crosswise.
    """
    material, stretch = KINDS["ogden"](poisson), 0.8
    mesh = bar([SIDE, SIDE, SIDE], [2, 2, 2])
    body = make_body(mesh, material, held_by_its_ends(mesh))
    lateral, density = closed_form(material, stretch)
    uniform, base = mesh.vertices * (stretch, lateral, lateral), mesh.vertices * (stretch, 1.0, 1.0)
    outcome = solve(EquilibriumSolver(body), uniform, base, tolerance=1e-8)
    assert outcome.converged, outcome.message
    assert outcome.state.summary.stable is True
    assert strain_energies(body, outcome.positions).sum() / SIDE**3 < 0.99 * density


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.45, 0.495, 0.4999])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("stretch", [0.85, 1.05, 1.6])
def test_block_follows_the_closed_form(make_body: MakeBody, kind: str, poisson: float, stretch: float) -> None:
    """A block of 2 x 2 x 2 cells, pulled or pressed, has the lateral stretch and energy of the closed form."""
    material = KINDS[kind](poisson)
    mesh = bar([SIDE, SIDE, SIDE], [2, 2, 2])
    body = make_body(mesh, material, held_by_its_ends(mesh))
    base = mesh.vertices * (stretch, 1.0, 1.0)
    outcome = solve(EquilibriumSolver(body), base, base, tolerance=1e-8)
    assert outcome.converged, outcome.message
    lateral, density = closed_form(material, stretch)
    np.testing.assert_allclose(outcome.positions, mesh.vertices * (stretch, lateral, lateral), atol=2e-5 * SIDE)
    energy = strain_energies(body, outcome.positions).sum() / SIDE**3
    assert energy == pytest.approx(density, rel=1e-3)
    np.testing.assert_allclose(element_fields(body, outcome.positions).J, stretch * lateral**2, atol=2e-5)

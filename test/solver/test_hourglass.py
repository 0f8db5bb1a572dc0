# SPDX-License-Identifier: Apache-2.0
"""Hourglass stiffness: no zero-energy modes, and correct bending and torsion of bars one element thick."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import simpson
from scipy.optimize import minimize_scalar

from gdfe_ros.command import Command
from gdfe_ros.constraints import Pose
from gdfe_ros.materials import Linear, Material
from gdfe_ros.mesh import HexMesh, bar
from gdfe_ros.mesh.generators import tube
from gdfe_ros.results.element_fields import corner_forces, strain_energies
from gdfe_ros.solver.body import Body
from gdfe_ros.solver.elements.hourglass import OWN_SHEAR
from gdfe_ros.solver.settings import Torsion
from test.written import simulate

MakeBody = Callable[..., Body]
SAINT_VENANT = {1.0: 0.14057702, 2.0: 0.22868168, 4.0: 0.28081212}
"""Dict from b/h to J / (b h^3) of a rectangle b x h (Timoshenko and Goodier)."""


def stiffness(body: Body, x: NDArray[np.float64], cell: int = 0) -> NDArray[np.float64]:
    """Return the tangent stiffness (24, 24) [N/m] of one of the elements by differences of its forces."""
    step, columns, none = 1e-7, [], np.zeros(len(body.cells))
    for corner, axis in np.ndindex(8, 3):
        move = np.zeros_like(x)
        move[body.cells[cell, corner], axis] = step
        after, before = (corner_forces(body, x + sign * move, none)[0][cell] for sign in (1.0, -1.0))
        columns.append(((after - before) / (2.0 * step)).ravel())
    return np.array(columns)


def assert_rigid_motions_free(matrix: NDArray[np.float64], scale: float) -> None:
    """Require six zero eigenvalues and eighteen positive ones, none small enough to hourglass, over ``scale`` [N/m]."""
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-6 * np.abs(matrix).max())
    values = np.linalg.eigvalsh(0.5 * (matrix + matrix.T)) / scale
    assert np.abs(values[:6]).max() < 1e-5
    assert values[6] > 5e-3


def test_only_rigid_motions_are_free(make_body: MakeBody, element: HexMesh, law: Material) -> None:
    """An undeformed cell has six zero eigenvalues and eighteen positive ones, none small enough to hourglass."""
    assert_rigid_motions_free(stiffness(make_body(element, law), element.vertices), law.young0 * np.cbrt(1e-3))


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.45])
@pytest.mark.parametrize("width", [0.25, 1.0, 3.0])
@pytest.mark.parametrize("length", [0.5, 1.0, 4.0])
@pytest.mark.parametrize("plane", ["xz", "xy", "yz"])
def test_pure_bending_one_element_thick(
    make_body: MakeBody, poisson: float, width: float, length: float, plane: str
) -> None:
    """A bar one cell thick, bent to curvature kappa with its anticlastic shape, has E I kappa^2 L / 2 within 1 %."""
    h, count, kappa = 0.01, 6, 1e-3
    mesh = bar([count * length * h, width * h, h], [count, 1, 1])
    x, y, z = mesh.vertices.T
    bent = np.stack([-kappa * x * z, poisson * kappa * y * z, 0.5 * kappa * x**2], axis=1)
    order = {"xz": [0, 1, 2], "xy": [2, 0, 1], "yz": [1, 2, 0]}[plane]  # the same bar along another axis
    turned = HexMesh(mesh.vertices[:, order], mesh.cells)
    energy = strain_energies(make_body(turned, Linear(young=1e5, poisson=poisson)), turned.vertices + bent[:, order])
    inertia = width * h * h**3 / 12.0
    expected = 0.5 * 1e5 * inertia * kappa**2 * count * length * h
    assert energy.sum() / expected == pytest.approx(1.0, rel=0.01)


def torsion_constant(make_body: MakeBody, cell: tuple[float, float, float], poisson: float) -> float:
    """Return the torsion constant [m^4] of a bar one cell thick whose sections warp by the best multiple of y z."""
    count, rate = 4, 1e-3
    mesh = bar([count * cell[0], *cell[1:]], [count, 1, 1])
    body = make_body(mesh, Linear(young=1e5, poisson=poisson))
    x, y, z = mesh.vertices.T

    def energy(warping: float) -> float:
        move = np.stack([warping * rate * y * z, -rate * x * z, rate * x * y], axis=1)
        return float(strain_energies(body, mesh.vertices + move).sum())

    least = minimize_scalar(energy, bounds=(-1.0, 1.0), method="bounded", options={"xatol": 1e-6}).fun
    return least / (0.5 * 1e5 / (2.0 * (1.0 + poisson)) * rate**2 * count * cell[0])


@pytest.mark.parametrize(
    ("ratio", "length", "poisson", "within"),
    [
        *((1.0, length, poisson, 0.01) for length in (0.5, 1.0, 4.0) for poisson in (0.0, 0.3, 0.45)),
        *((ratio, 1.0, 0.3, 0.10) for ratio in (2.0, 4.0)),  # its warping is not exact
    ],
)
def test_torsion_of_a_bar_one_element_thick(
    make_body: MakeBody, ratio: float, length: float, poisson: float, within: float
) -> None:
    """A bar (ratio x 1) of one cell has Saint-Venant's torsion constant, for short and long cells."""
    h = 0.01
    found = torsion_constant(make_body, (length * h, ratio * h, h), poisson)
    assert found / (SAINT_VENANT[ratio] * ratio * h**4) == pytest.approx(1.0, rel=within)


def test_what_is_one_cell_thick_keeps_its_bits(make_body: MakeBody, law: Material) -> None:
    """The forces of a shell one cell thick are the same bits by cells and by sections."""
    mesh = bar([0.04, 0.03, 0.01], [4, 3, 1])
    x = mesh.vertices + np.random.default_rng(2).uniform(-1e-3, 1e-3, mesh.vertices.shape)
    cell, section = (corner_forces(make_body(mesh, law, torsion=kind), x, np.zeros(12))[0] for kind in Torsion)
    np.testing.assert_array_equal(cell, section)


def test_what_is_round_keeps_its_bits(make_body: MakeBody) -> None:
    """The forces of a tube are the same bits by cells and by sections, as a round section twists without warping."""
    mesh = tube(0.01, 0.02, 0.04, [2, 16, 4], cap=0.01, cap_cells=2)
    x = mesh.vertices + np.random.default_rng(2).uniform(-1e-3, 1e-3, mesh.vertices.shape)
    none = np.zeros(mesh.n_cells)
    cell, section = (corner_forces(make_body(mesh, torsion=kind), x, none)[0] for kind in Torsion)
    np.testing.assert_array_equal(cell, section)


def test_a_plate_of_two_layers_twists_as_kirchhoffs(make_body: MakeBody) -> None:
    """The twist energy of a thin plate of two layers is D (1 - nu) w_xy^2 times its area, by sections and by cells."""
    thick, rate, poisson, mesh = 0.01, 1e-3, 0.3, bar([0.2, 0.2, 0.01], [4, 4, 2])
    x, y, z = mesh.vertices.T
    move = rate * np.stack([-y * z, -x * z, x * y], axis=1)
    expected = 1e5 * thick**3 / (12.0 * (1.0 - poisson**2)) * (1.0 - poisson) * rate**2 * 0.04
    for torsion in Torsion:
        body = make_body(mesh, Linear(young=1e5, poisson=poisson), torsion=torsion)
        assert strain_energies(body, mesh.vertices + move).sum() == pytest.approx(expected, rel=1e-3)


def test_sections_leave_no_motion_free(make_body: MakeBody, law: Material) -> None:
    """With sections, a cell inside a block has six zero eigenvalues, even with the least weight of its own shear."""
    mesh = bar([0.5, 0.5, 0.5], [5, 5, 5])
    body, inner = make_body(mesh, law, torsion=Torsion.SECTION), 62
    assert body.shape.across[inner] > len(OWN_SHEAR)
    assert_rigid_motions_free(stiffness(body, mesh.vertices, inner), law.young0 * 0.1)


def test_forces_by_sections_are_the_gradient_of_the_energy(make_body: MakeBody) -> None:
    """Forces by sections equal differences of the energy in a largely deformed sheared block."""
    mesh, random = bar([0.3, 0.3, 0.3], [3, 3, 3]), np.random.default_rng(7)
    sheared = mesh.vertices @ np.array([[1.0, 0.3, 0.1], [0.0, 1.2, 0.4], [0.0, 0.0, 0.7]])
    mesh = HexMesh(sheared, mesh.cells)
    body = make_body(mesh, torsion=Torsion.SECTION)
    assert (body.shape.across == 3).all()
    x = mesh.vertices @ np.diag([1.3, 0.8, 0.9]) + random.uniform(-0.01, 0.01, mesh.vertices.shape)
    force, move = np.zeros_like(x), random.normal(size=x.shape)
    np.add.at(force, body.cells, corner_forces(body, x, np.zeros(27))[0])
    after, before = (strain_energies(body, x + sign * 1e-6 * move).sum() for sign in (1.0, -1.0))
    assert np.vdot(force, move) == pytest.approx((after - before) / 2e-6, rel=1e-6)


@pytest.mark.parametrize("stretch", [0.3, 0.7, 1.5, 3.0])
def test_no_mode_is_free_in_a_stretched_element(make_body: MakeBody, law: Material, stretch: float) -> None:
    """In a stretched element, bending along each hourglass mode increases the energy."""
    cube = bar([0.1, 0.1, 0.1], [1, 1, 1])
    body = make_body(cube, law)
    base = cube.vertices @ np.diag([stretch, stretch**-0.5, stretch**-0.5])
    modes = body.shape.hourglass[0][:, np.argsort(body.cells[0])]
    rest = strain_energies(body, base)[0]
    for mode, axis in product(range(4), range(3)):
        move = np.zeros((8, 3))
        move[:, axis] = 1e-3 * modes[mode]
        assert strain_energies(body, base + move)[0] > rest


TWISTED = """
materials: {soft: {law: neo_hookean, young: 1.0e5, poisson: 0.45}}
handles: {base: {where: {face: x-}, fixed: true}, tip: {where: {face: x+}}}
solver: {tolerance: 1.0e-7}
"""


def excess_of_work(across: int) -> float:
    """Return work over stored energy, minus 1, of a bar with ``across`` cells over its thickness, twisted by 90 deg."""
    simulation = simulate(TWISTED, mesh={"bar": {"size": [0.04, 0.02, 0.02], "cells": [4, across, across]}})
    angles, torques = np.linspace(0.0, np.pi / 2, 13), [0.0]
    for angle in angles[1:]:
        result = simulation.step(Command(handles={"tip": Pose(rotation=(angle, 0.0, 0.0))}))
        torques.append(result.reactions["tip"][3])
    return float(simpson(torques, x=angles)) / result.energy - 1.0


def test_the_work_of_a_far_twist_differs_from_the_energy() -> None:
    """Work and energy of a twisted bar differ by 1 to 2 % with two cells across, and by a third of this with four."""
    coarse, fine = excess_of_work(2), excess_of_work(4)
    assert 0.01 < coarse < 0.02
    assert fine == pytest.approx(coarse / 3.0, rel=0.15)

# SPDX-License-Identifier: Apache-2.0
"""Element forces, energies and fields: derivatives, balances, symmetries, closed forms."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.actuators import Growth, Mode
from gdfe_ros.materials import Curve, CurveData, Law, Linear, Material, NeoHookean, preset
from gdfe_ros.materials.table import PENALTY
from gdfe_ros.mesh import HexMesh, bar
from gdfe_ros.mesh.cells.filling import CORNERS, Filling
from gdfe_ros.mesh.cells.operators import shape_operators
from gdfe_ros.results.element_fields import corner_forces, element_fields, strain_energies, volume_pressures
from gdfe_ros.solver.body import Body, Growths
from gdfe_ros.solver.elements.measures import least_volume_ratio, update_pressures

MakeBody = Callable[..., Body]
GRADIENT = np.array([[1.3, 0.4, -0.1], [0.2, 0.8, 0.3], [-0.2, 0.1, 1.1]])
NO_SOFTENING = [
    Linear(young=1e5, poisson=0.0),
    Linear(young=1e5, poisson=0.3),
    Linear(young=1e5, poisson=0.49),
    Curve(data=CurveData.polynomial([1e5]), poisson=0.4),
]
"""Laws with a constant tangent modulus, so that their hourglass stiffness does not depend on the strain."""


def vertex_forces(body: Body, x: NDArray[np.float64], pressure: float = 0.0) -> NDArray[np.float64]:
    """Return the force (n, 3) [N] on every vertex."""
    corners, _ = corner_forces(body, x, np.full(len(body.cells), pressure))
    total = np.zeros_like(x)
    np.add.at(total, body.cells.ravel(), corners.reshape(-1, 3))
    return total


def crumpled(mesh: HexMesh, amount: float, seed: int = 0) -> NDArray[np.float64]:
    """Return positions deformed by `GRADIENT`, each vertex displaced at random by up to ``amount`` edge lengths."""
    random = np.random.default_rng(seed)
    edge = mesh.size / np.sqrt(3.0) / np.cbrt(mesh.n_cells)
    return mesh.vertices @ GRADIENT.T + amount * edge * random.uniform(-1.0, 1.0, mesh.vertices.shape)


@pytest.mark.parametrize("material", NO_SOFTENING, ids=["nu 0", "nu 0.3", "nu 0.49", "straight curve"])
@pytest.mark.parametrize("amount", [0.1, 0.5, 2.0], ids=["bent", "crumpled", "tangled"])
def test_forces_are_the_derivative_of_the_energy(
    make_body: MakeBody, element: HexMesh, material: Material, amount: float
) -> None:
    """Corner forces of bent and tangled elements equal differences of the energy, hourglass energy included."""
    body, pressure = make_body(element, material), np.array([2e4])
    x, step = crumpled(element, amount), 1e-7
    forces, slopes = vertex_forces(body, x, pressure[0]), np.zeros((8, 3))
    for corner in np.ndindex(8, 3):
        move = np.zeros((8, 3))
        move[corner] = step
        change = corner_forces(body, x + move, pressure)[1] - corner_forces(body, x - move, pressure)[1]
        slopes[corner] = change[0] / (2.0 * step)
    np.testing.assert_allclose(slopes, forces, rtol=0.0, atol=1e-6 * np.abs(forces).max())


def test_rigid_motion_costs_no_energy(make_body: MakeBody, distorted: HexMesh, law: Material) -> None:
    """A rigid motion of a distorted body causes neither energy nor forces."""
    body = make_body(distorted, law)
    for vector in [(0.2, -0.4, 0.9), (np.pi, 0.0, 0.0), (0.0, 3.0, 1.0)]:
        x = distorted.vertices @ Rotation.from_rotvec(vector).as_matrix().T + np.array([3.0, -1.0, 2.0])
        assert strain_energies(body, x).sum() < 1e-12 * law.bulk
        assert np.abs(vertex_forces(body, x)).max() < 1e-11 * law.bulk * distorted.size**2


def test_forces_turn_with_the_body(make_body: MakeBody, distorted: HexMesh, law: Material) -> None:
    """A rotated crumpled body has the same energies and rotated forces."""
    body, x = make_body(distorted, law), crumpled(distorted, 0.2)
    turn = Rotation.from_rotvec([0.5, 2.0, -1.0]).as_matrix()
    here, there = vertex_forces(body, x), vertex_forces(body, np.ascontiguousarray(x @ turn.T))
    np.testing.assert_allclose(there, here @ turn.T, atol=1e-9 * np.abs(here).max())
    np.testing.assert_allclose(strain_energies(body, x @ turn.T), strain_energies(body, x), rtol=1e-9)


@pytest.mark.exact("renumbered vertices are shifted otherwise")
def test_renumbering_vertices_permutes_the_forces(make_body: MakeBody, distorted: HexMesh, law: Material) -> None:
    """Renumbering the vertices leaves each element's energy and each vertex's force unchanged."""
    order = np.random.default_rng(0).permutation(distorted.n_vertices)
    shuffled = HexMesh(distorted.vertices[order], np.argsort(order)[distorted.cells])
    x = crumpled(distorted, 0.2)
    here, there = make_body(distorted, law), make_body(shuffled, law)
    np.testing.assert_array_equal(strain_energies(there, x[order]), strain_energies(here, x))
    forces = vertex_forces(here, x)
    np.testing.assert_allclose(vertex_forces(there, x[order]), forces[order], atol=1e-12 * np.abs(forces).max())


def test_an_element_does_not_notice_its_neighbours_material(make_body: MakeBody, distorted: HexMesh) -> None:
    """In a body of several laws and shapes, each element's forces have the same bits as in a body of its law alone."""
    laws = [
        Linear(young=1e5, poisson=0.3),
        NeoHookean(young=2e5, poisson=0.495),
        preset("cheetah", law=Law.OGDEN, poisson=0.495),
        preset("ninjaflex", law=Law.CURVE, poisson=0.4),
    ]
    block = bar([0.3, 0.3, 0.3], [3, 3, 3])
    both = HexMesh(
        np.vstack([distorted.vertices, block.vertices + 1.0]),
        np.vstack([distorted.cells, block.cells + distorted.n_vertices]),
    )
    which = np.random.default_rng(0).integers(0, len(laws), both.n_cells).astype(np.int32)
    x, pressure = crumpled(both, 0.1), np.random.default_rng(1).uniform(-1e4, 1e4, both.n_cells)
    forces, energies = corner_forces(make_body(both, laws, cell_material=which), x, pressure)
    for index, law in enumerate(laws):
        own_forces, own_energies = corner_forces(make_body(both, law), x, pressure)
        np.testing.assert_array_equal(energies[which == index], own_energies[which == index])
        np.testing.assert_array_equal(forces[which == index], own_forces[which == index])


def test_turning_the_numbering_of_a_cell_changes_nothing(make_body: MakeBody, element: HexMesh, law: Material) -> None:
    """A cyclic renumbering of a cell's corners leaves its energy and forces unchanged."""
    x = crumpled(element, 0.3)
    here = make_body(element, law)
    energy, forces = strain_energies(here, x)[0], vertex_forces(here, x)
    for turned in ([1, 2, 3, 0, 5, 6, 7, 4], [3, 2, 6, 7, 0, 1, 5, 4], [0, 3, 7, 4, 1, 2, 6, 5]):
        there = make_body(HexMesh(element.vertices, element.cells[:, turned]), law)
        assert strain_energies(there, x)[0] == pytest.approx(energy, rel=1e-10)
        np.testing.assert_allclose(vertex_forces(there, x), forces, atol=1e-9 * np.abs(forces).max())


def test_linear_field_costs_what_the_law_says_on_any_mesh(
    make_body: MakeBody, distorted: HexMesh, law: Material
) -> None:
    """A distorted body under a uniform F has the energy density of a cube, without hourglass energy."""
    cube = bar([1.0, 1.0, 1.0], [1, 1, 1])
    density = strain_energies(make_body(cube, law), cube.vertices @ GRADIENT.T)[0]
    fields = element_fields(make_body(distorted, law), distorted.vertices @ GRADIENT.T)
    np.testing.assert_allclose(fields.energy_density, density, rtol=1e-9)


def test_fields_of_a_grown_body_are_per_undeformed_volume(
    make_body: MakeBody, distorted: HexMesh, law: Material
) -> None:
    """With growth, the energy density is det G W(F G^-1), per undeformed volume, and J is det F / det G."""
    stretch, body = np.diag([1.2, 1.0, 0.8]), make_body(distorted, law)
    growths = Growths(body, [Growth(name="g", mode=Mode.GROWTH, cells=np.arange(distorted.n_cells), stretch=stretch)])
    operators = growths.at({"g": 1.0}, growths.ungrown)
    grown = element_fields(body, distorted.vertices @ GRADIENT.T, operators=operators)
    elastic = element_fields(body, distorted.vertices @ (GRADIENT @ np.linalg.inv(stretch)).T)
    np.testing.assert_allclose(grown.energy_density, 0.96 * elastic.energy_density, rtol=1e-8)
    np.testing.assert_allclose(grown.J, np.linalg.det(GRADIENT) / 0.96, rtol=1e-8)


def test_sign_patterns_equal_the_general_operators(make_body: MakeBody, law: Material) -> None:
    """The fast formula for a cube agrees with the general one for a cube with a corner displaced by 1e-7 edges."""
    cube = bar([0.1, 0.1, 0.1], [1, 1, 1])
    bumped = cube.vertices.copy()
    bumped[7, 0] += 1e-8
    x = crumpled(cube, 0.3)
    fast, general = make_body(cube, law), make_body(HexMesh(bumped, cube.cells), law)
    assert fast.shape.parallel[0] != general.shape.parallel[0]
    forces = vertex_forces(fast, x)
    np.testing.assert_allclose(vertex_forces(general, x), forces, atol=2e-5 * np.abs(forces).max())


def test_equivalent_strain_is_equation_five(make_body: MakeBody, distorted: HexMesh, law: Material) -> None:
    """eps_eq (Eq. 5) and J equal those from singular values; nu is 1/2, except that the linear law uses its own nu."""
    fields = element_fields(make_body(distorted, law), distorted.vertices @ GRADIENT.T)
    l0, l1, l2 = np.linalg.svd(GRADIENT)[1]
    nu = law.poisson if type(law) is Linear else 0.5
    expected = np.sqrt(((l0 - l1) ** 2 + (l1 - l2) ** 2 + (l2 - l0) ** 2) / 2.0) / (1.0 + nu)
    np.testing.assert_allclose(fields.eps_eq, expected, rtol=1e-9)
    np.testing.assert_allclose(fields.J, np.linalg.det(GRADIENT), rtol=1e-12)


@pytest.mark.parametrize(
    "stretch",
    [pytest.param(1.0, marks=pytest.mark.exact("a strain of zero is the root of rounding")), 1.001, 1.3, 2.0, 3.5],
)
def test_moduli_are_those_of_the_uniaxial_curve(make_body: MakeBody, law: Material, stretch: float) -> None:
    """The tangent modulus is the slope of the uniaxial curve, the secant modulus Phi'/eps_eq, both in Pa."""
    cube = bar([0.1, 0.1, 0.1], [1, 1, 1])
    if type(law) is Linear:
        lateral = stretch**-0.5  # eps_eq takes the law's own nu: see where the curve is read
        strain = (stretch - lateral) / (1.0 + law.poisson)
        modulus = {"tangent": law.young, "secant": None}
    else:
        strain = (stretch - stretch**-0.5) / 1.5
        stress, slope = law.stress_at(np.array(stretch - 1.0)), law.tangent_at(np.array(stretch - 1.0))
        modulus = {"tangent": slope, "secant": stress * 1.5 / (1.0 + 0.5 * stretch**-1.5) / max(strain, 1e-300)}
    if stretch == 1.0:
        modulus["secant"] = law.tangent_at(np.zeros(1))[0]
    x = cube.vertices @ np.diag([stretch, stretch**-0.5, stretch**-0.5])
    fields = element_fields(make_body(cube, law), x)
    assert fields.eps_eq[0] == pytest.approx(strain, rel=1e-8, abs=1e-8)
    assert fields.tangent[0] == pytest.approx(modulus["tangent"], rel=5e-3)
    if modulus["secant"] is not None:
        assert fields.secant[0] == pytest.approx(modulus["secant"], rel=1e-5)


def test_shape_factor_is_the_secant_over_the_largest(make_body: MakeBody) -> None:
    """The shape factor omega is the secant modulus over the largest one in the body: 1 in the stiffest cell."""
    mesh = bar([0.2, 0.1, 0.1], [2, 1, 1])
    materials = [Linear(young=1e5, poisson=0.3), Linear(young=2.5e4, poisson=0.3)]
    body = make_body(mesh, materials, cell_material=np.array([0, 1], np.int32))
    fields = element_fields(body, mesh.vertices @ GRADIENT.T)
    np.testing.assert_allclose(fields.omega, fields.secant / fields.secant.max())
    np.testing.assert_allclose(fields.omega, [1.0, 0.25], rtol=1e-6)


def test_pressures_carry_the_full_volume_energy(make_body: MakeBody, law: Material) -> None:
    """Forces with the updated pressures equal the derivative of the whole energy of a cube swollen by 3 %."""
    cube = bar([0.1, 0.1, 0.1], [1, 1, 1])
    body, step = make_body(cube, law), 1e-6
    x = 1.01 * cube.vertices
    pressure = volume_pressures(body, x)
    power = np.vdot(corner_forces(body, x, pressure)[0][0], cube.vertices[cube.cells[0]])
    slope = strain_energies(body, x + step * cube.vertices) - strain_energies(body, x - step * cube.vertices)
    assert power == pytest.approx(slope[0] / (2.0 * step), rel=1e-7)
    assert bool(pressure[0] == 0.0) is (law.poisson <= 0.45)


@pytest.mark.parametrize("pressure", [1e4, 0.0, -1e6, -1e9, -1e12])
def test_pressures_stay_finite_however_far_an_element_is_crushed(
    make_body: MakeBody, element: HexMesh, pressure: float
) -> None:
    """In an element crushed to a hundredth, the new pressure is that of the volume J* with U'(J*) = p, to 1e-3."""
    young, poisson = 1e5, 0.495
    body = make_body(element, NeoHookean(young=young, poisson=poisson))
    pressures, kappa = np.array([pressure]), body.table.parameters[0, PENALTY]
    update_pressures(0.01 * element.vertices, np.zeros(1, np.int32), body.shape, body.material, body.table, pressures)
    total, lame = pressure + kappa * (1e-6 - 1.0), young * poisson / (1.0 + poisson) / (1.0 - 2.0 * poisson)
    target = 1.0 + (total - pressures[0]) / kappa
    assert target > 0.0
    assert lame * np.log(target) == pytest.approx(total * target, rel=1e-3)


def test_a_cut_cell_folds_where_its_material_does() -> None:
    """The least det F of a partly filled cell is taken at the corners of its filled box, not of the cell."""
    corners = 0.5 * CORNERS
    cells = np.arange(8, dtype=np.int32)[None]
    filling = Filling(np.array([0.15]), np.array([[-0.5, 0.1, 0.0]]), np.array([[0.5, 0.6, 1.0]]))
    shape = shape_operators(corners, cells, filling)
    moved = corners + np.array([0.2, 0.3, -0.1]) * CORNERS.prod(axis=1)[:, None]
    assert least_volume_ratio(moved, shape) == pytest.approx(least_of_box(moved, filling), rel=1e-8)
    pulled = corners.copy()
    pulled[1, 0] -= 1.1
    assert least_volume_ratio(pulled, shape_operators(corners, cells)) < 0.0
    assert least_volume_ratio(pulled, shape) == pytest.approx(least_of_box(pulled, filling), rel=1e-8)
    assert least_volume_ratio(pulled, shape) > 0.15
    pulled[0, 0] += 1.3
    assert least_volume_ratio(pulled, shape) < 0.0


def least_of_box(positions: NDArray[np.float64], filling: Filling) -> float:
    """Return the least det F at the corners of a unit cube's filled box, by differences of the trilinear field."""
    found = []
    for place in filling.points(CORNERS)[0]:
        ends = [0.125 * np.prod(1.0 + (place + step) * CORNERS, axis=1) @ positions for step in 1e-6 * np.eye(3)]
        backs = [0.125 * np.prod(1.0 + (place - step) * CORNERS, axis=1) @ positions for step in 1e-6 * np.eye(3)]
        found.append(np.linalg.det((np.array(ends) - np.array(backs)) / 1e-6))
    return min(found)

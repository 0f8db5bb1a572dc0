# SPDX-License-Identifier: Apache-2.0
"""Each law on one cube against its formula, written again from the docstrings and docs/theory/energy.md."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from gdfe_ros.materials import Curve, Linear, Material, NeoHookean, StableNeoHookean
from gdfe_ros.solver.elements.barrier import THRESHOLD, WEIGHT
from test.materials.formulas import energy_density

MakeCube = Callable[[Material], Any]
STRETCHES = [0.6, 1.0 + 1e-6, 1.01, 1.1, 1.5, 2.0, 3.0, 5.0]


def deviatoric_tension(material: Material, stretch: ArrayLike) -> NDArray[np.float64]:
    """Return the nominal stress [Pa] of uniaxial tension at J = 1, where a pressure removes the lateral stress."""
    stretch = np.asarray(stretch)
    lateral = stretch**-0.5
    if isinstance(material, NeoHookean):
        return material.shear0 * (stretch - stretch**-2.0)
    if isinstance(material, StableNeoHookean):
        return 3.0 * material.shear0 / material.young * material.stress_at(stretch - 1.0)
    if isinstance(material, Linear):
        return material.young / (1.0 + material.poisson) * (stretch - lateral) * (2.0 + lateral / stretch) / 3.0
    return material.stress_at(stretch - 1.0)


def uniaxial(stretch: float) -> NDArray[np.float64]:
    """Return F of uniaxial tension along x at J = 1."""
    return np.diag([stretch, stretch**-0.5, stretch**-0.5])


@pytest.mark.parametrize("stretch", STRETCHES)
def test_uniaxial_tension_follows_the_curve(law: Material, cube: MakeCube, stretch: float) -> None:
    """At constant volume, the stress minus lateral traction is the law's uniaxial curve."""
    if stretch < 1.0 and isinstance(law, Curve):
        pytest.skip("a curve is exact in tension only")
    stress = cube(law).stress(uniaxial(stretch))
    nominal = stress[0, 0] - stress[1, 1] * stretch**-1.5
    assert nominal == pytest.approx(float(deviatoric_tension(law, stretch)), rel=2e-6, abs=1e-7 * law.shear0)


def test_energy_is_the_formula_at_random_deformations(law: Material, cube: MakeCube) -> None:
    """Under random deformations with stretches from 0.5 to 3, the energy is the law's formula."""
    random = np.random.default_rng(1)
    for _ in range(20):
        stretches = np.exp(random.uniform(np.log(0.5), np.log(3.0), 3))
        u, v = Rotation.random(2, random_state=random).as_matrix()
        density = cube(law).density(u @ np.diag(stretches) @ v.T)
        assert density == pytest.approx(energy_density(law, stretches), rel=1e-6, abs=1e-9 * law.shear0)


def test_inverted_energy_counts_the_smallest_stretch_negative(corotated_law: Material, cube: MakeCube) -> None:
    """For an inverted cube, the law has one negative stretch, and the fold barrier at the corners adds its energy."""
    u, v = Rotation.random(2, random_state=2).as_matrix()
    stretches = np.array([1.2, 1.0, -0.3])
    density = cube(corotated_law).density(u @ np.diag(stretches) @ v.T)
    line = 0.9**3 / 0.1 - 0.9**2 * 1.2 / 0.1**2 * (stretches.prod() / THRESHOLD - 0.1)  # of b(s) below s = 0.1
    expected = energy_density(corotated_law, stretches) + WEIGHT * corotated_law.shear0 * line
    assert density == pytest.approx(expected, rel=1e-6)


def test_an_inverted_cube_costs_more_than_its_mirror_image(law: Material, cube: MakeCube) -> None:
    """At equal stretches an inverted cube has more energy than an upright one, for every law."""
    for squeeze in (0.05, 0.3, 1.0):
        upright, inverted = (cube(law).density(np.diag([1.2, 1.0, sign * squeeze])) for sign in (1.0, -1.0))
        assert inverted > upright


DEFORMED = {
    "random": [1.3, 0.9, 0.8],
    "large": [4.0, 2.0, 0.4],
    "squeezed": [1.3, 0.9, 0.04],
    "needle": [1.5, 0.06, 0.03],
    "flat": [1.1, 0.9, 0.0],
    "inverted": [1.3, 0.9, -0.6],
    "inverted-needle": [1.5, 0.06, -0.03],
    "inverted-far": [1.3, 0.9, -0.85],
}
"""Signed principal stretches; in one set the last two nearly cancel, so that the rotation is hardly defined."""


@pytest.mark.parametrize("stretches", DEFORMED.values(), ids=DEFORMED)
def test_forces_are_the_derivative_of_the_energy(law: Material, cube: MakeCube, stretches: list[float]) -> None:
    """The forces of a deformed cube are central differences of its energy."""
    random = np.random.default_rng(3)
    body = cube(law)
    for _ in range(3):
        u, v = Rotation.random(2, random_state=random.integers(1000)).as_matrix()
        x = body.positions(u @ np.diag(stretches) @ v.T)
        forces, slopes, step = body.forces(x), np.zeros((8, 3)), 1e-6 * body.side
        for corner in np.ndindex(8, 3):
            move = np.zeros((8, 3))
            move[corner] = step
            slopes[corner] = (body.energy(x + move) - body.energy(x - move)) / (2.0 * step)
        np.testing.assert_allclose(slopes, forces, rtol=0.0, atol=2e-6 * np.abs(forces).max())


@pytest.mark.parametrize("plane", [(0, 1), (1, 2), (2, 0), (1, 0)])
def test_small_shear_has_the_shear_modulus(law: Material, cube: MakeCube, plane: tuple[int, int]) -> None:
    """Under a shear of 1e-5 the shear stress is mu0 times the shear, on both faces."""
    shear = 1e-5
    gradient = np.eye(3)
    gradient[plane] += shear
    stress = cube(law).stress(gradient)
    assert stress[plane] == pytest.approx(law.shear0 * shear, rel=1e-3)
    assert stress[plane[::-1]] == pytest.approx(law.shear0 * shear, rel=1e-3)


def test_small_tension_has_youngs_modulus_and_poissons_ratio(law: Material, cube: MakeCube) -> None:
    """Under a strain of 1e-5 with lateral strain -nu 1e-5, the stress is E0 times the strain, and zero across."""
    strain = 1e-5
    lateral = 1.0 - law.poisson * strain
    stress = cube(law).stress(np.diag([1.0 + strain, lateral, lateral]))
    assert stress[0, 0] == pytest.approx(law.young0 * strain, rel=3e-3)
    assert abs(stress[1, 1]) < 3e-3 * law.young0 * strain


def test_rotation_costs_nothing(law: Material, cube: MakeCube) -> None:
    """A rotation by any angle, half turns included, causes neither energy nor force."""
    for vector in [(0, 0, 0), (0.1, 0.2, 0.3), (np.pi, 0, 0), (0, 2.0, -2.0), (1e-9, 0, 0)]:
        turn = Rotation.from_rotvec(vector).as_matrix()
        assert abs(cube(law).density(turn)) < 1e-12 * law.bulk
        assert np.abs(cube(law).stress(turn)).max() < 1e-11 * law.bulk


@pytest.mark.parametrize(
    "gradient",
    [
        np.zeros((3, 3)),
        np.diag([1.0, 1.0, 0.0]),
        np.diag([1.0, 0.0, 0.0]),
        -np.eye(3),
        np.diag([-1.0, 1.0, 1.0]),
        np.diag([1e-9, 1.0, -1e-9]),
        1e3 * np.eye(3),
        -1e3 * np.eye(3),
        np.diag([100.0, 1e-3, 1e-3]),
    ],
    ids=["point", "flat", "needle", "mirrored", "inside-out", "almost-needle", "huge", "huge-mirrored", "thread"],
)
def test_no_deformation_overflows(law: Material, cube: MakeCube, gradient: NDArray[np.float64]) -> None:
    """Under collapse, inversion and large expansion, energy and forces are finite, and the energy is positive."""
    assert np.isfinite(cube(law).density(gradient))
    assert cube(law).density(gradient) > 0.0
    assert np.isfinite(cube(law).stress(gradient)).all()


@pytest.mark.parametrize("squeeze", [0.9, 0.5, 0.2, 0.05, 0.0, -0.3, -1.0, -3.0])
def test_a_squeezed_cube_pushes_back(law: Material, cube: MakeCube, squeeze: float) -> None:
    """A cube squeezed to zero and beyond is always pushed towards its undeformed shape."""
    assert cube(law).stress(np.diag([1.0, 1.0, squeeze]))[2, 2] < 0.0


def test_the_pressure_term_meets_the_plain_law_at_moderate_poisson(cube: MakeCube) -> None:
    """Energy and stress are continuous at nu = 0.45, above which a pressure multiplier carries the volume energy."""
    gradient = np.array([[1.1, 0.2, 0.0], [0.1, 0.9, 0.1], [0.0, 0.1, 1.05]])
    for kind in (Linear, NeoHookean, StableNeoHookean):
        plain, carried = cube(kind(young=1e5, poisson=0.45)), cube(kind(young=1e5, poisson=0.45 + 1e-9))
        assert carried.density(gradient) == pytest.approx(plain.density(gradient), rel=1e-6)
        np.testing.assert_allclose(carried.stress(gradient), plain.stress(gradient), rtol=1e-6, atol=1e-3)

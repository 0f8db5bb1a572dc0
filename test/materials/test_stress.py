# SPDX-License-Identifier: Apache-2.0
"""Each law on one cube against its formula, written again from the docstrings and docs/theory/energy.md."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from gdfe_ros.materials import (
    ArrudaBoyce,
    Gent,
    Linear,
    Material,
    MooneyRivlin,
    NeoHookean,
    Ogden,
    StableNeoHookean,
    Yeoh,
)
from gdfe_ros.solver.elements.barrier import THRESHOLD, WEIGHT

MakeCube = Callable[[Material], Any]
STRETCHES = [1.0 + 1e-6, 1.01, 1.1, 1.5, 2.0, 3.0, 5.0]


def area_under(curve: Callable[[NDArray[np.float64]], NDArray[np.float64]], end: float) -> float:
    """Return the integral of a curve from 0 to ``end``, by Gauss points on 200 intervals."""
    points, weights = np.polynomial.legendre.leggauss(4)
    edges = np.linspace(0.0, end, 201)
    nodes = edges[:-1, None] + 0.5 * (points + 1.0) * np.diff(edges)[:, None]
    return float(np.sum(curve(nodes) @ weights) * end / 400.0)


def energy_density(material: Material, stretches: NDArray[np.float64]) -> float:
    """Return W [J/m^3] at signed principal stretches, by the law's formula."""
    l, j = np.asarray(stretches), float(np.prod(stretches))  # noqa: E741
    volumetric = 0.5 * material.bulk * (j - 1.0) ** 2
    spread = np.sum((l - l.mean()) ** 2)
    if isinstance(material, NeoHookean):
        mu, nu = material.shear0, material.poisson
        lame = 2.0 * mu * nu / (1.0 - 2.0 * nu)
        return 0.5 * mu * (np.sum(l**2) - 3.0) - mu * np.log(j) + 0.5 * lame * np.log(j) ** 2
    if isinstance(material, StableNeoHookean):
        shear = material.shear0
        mu, lame = (
            4.0 / 3.0 * shear,
            2.0 * shear * material.poisson / (1.0 - 2.0 * material.poisson) + 5.0 / 6.0 * shear,
        )
        alpha = 1.0 + 0.75 * mu / lame
        first, rest = np.sum(l**2), 0.5 * lame * (1.0 - alpha) ** 2 - 0.5 * mu * np.log(4.0)
        paper = 0.5 * mu * (first - 3.0) + 0.5 * lame * (j - alpha) ** 2 - 0.5 * mu * np.log(first + 1.0)
        return float(paper - rest)
    if isinstance(material, Linear):
        return 0.5 * material.young / (1.0 + material.poisson) * spread + volumetric
    if isinstance(material, Ogden):
        isochoric = l * j ** (-1.0 / 3.0)
        terms = zip(material.mu, material.alpha, strict=True)
        return sum(2.0 * m / a**2 * (np.sum(isochoric**a) - 3.0) for m, a in terms) + volumetric
    invariant = np.sum(l**2 * j ** (-2.0 / 3.0))
    if isinstance(material, MooneyRivlin):
        second = np.sum(l**-2.0 * j ** (2.0 / 3.0))
        return material.c10 * (invariant - 3.0) + material.c01 * (second - 3.0) + volumetric
    if isinstance(material, Yeoh):
        x = invariant - 3.0
        end = material.end
        at, line = min(x, end), max(x - end, 0.0)
        c1, c2, c3 = material.c10, material.c20, material.c30
        return c1 * at + c2 * at**2 + c3 * at**3 + line * (c1 + 2.0 * c2 * at + 3.0 * c3 * at**2) + volumetric
    if isinstance(material, ArrudaBoyce):
        factors = (1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750)
        parts = (
            c / material.lambda_m ** (2 * i) * (invariant ** (i + 1) - 3.0 ** (i + 1)) for i, c in enumerate(factors)
        )
        return material.mu * sum(parts) + volumetric
    if isinstance(material, Gent):
        x, mu, jm = invariant - 3.0, material.mu, material.jm
        at, beyond = min(x, 0.99 * jm), max(x - 0.99 * jm, 0.0)
        more = beyond * 0.5 * mu / 0.01 + 0.25 * beyond**2 * mu / jm / 0.01**2
        return -0.5 * mu * jm * np.log(1.0 - at / jm) + more + volumetric
    equivalent = np.sqrt(1.5 * spread) / 1.5
    stretch = brentq(lambda t: (t - t**-0.5) / 1.5 - equivalent, 1.0, 20.0, xtol=1e-14) if equivalent > 0.0 else 1.0
    return area_under(material.stress_at, stretch - 1.0) + volumetric


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
    stress = cube(law).stress(uniaxial(stretch))
    nominal = stress[0, 0] - stress[1, 1] * stretch**-1.5
    assert nominal == pytest.approx(float(deviatoric_tension(law, stretch)), rel=2e-6, abs=1e-7 * law.shear0)


@pytest.mark.parametrize("stretch", STRETCHES)
def test_uniaxial_energy_is_the_area_under_the_curve(law: Material, cube: MakeCube, stretch: float) -> None:
    """At constant volume, the energy density is the work of the uniaxial stress."""
    work = area_under(lambda strain: deviatoric_tension(law, 1.0 + strain), stretch - 1.0)
    assert cube(law).density(uniaxial(stretch)) == pytest.approx(work, rel=2e-6, abs=1e-10 * law.shear0)


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


@pytest.mark.parametrize("stretch", [0.7, 0.95, 1.0, 1.05, 1.5])
def test_hydrostatic_tension_is_the_bulk_law(law: Material, cube: MakeCube, stretch: float) -> None:
    """Under equal stretches there is no shear, and the traction is the derivative of the volume energy."""
    stress = cube(law).stress(stretch * np.eye(3))
    step = 1e-5
    swollen, shrunk = (energy_density(law, (stretch + s) * np.ones(3)) for s in (step, -step))
    expected = (swollen - shrunk) / (2.0 * step) / 3.0
    np.testing.assert_allclose(stress, expected * np.eye(3), rtol=1e-6, atol=1e-6 * law.bulk)


@pytest.mark.parametrize("plane", [(0, 1), (1, 2), (2, 0), (1, 0)])
def test_small_shear_has_the_shear_modulus(law: Material, cube: MakeCube, plane: tuple[int, int]) -> None:
    """Under a shear of 1e-5 the shear stress is mu0 times the shear, on both faces."""
    shear = 1e-5
    gradient = np.eye(3)
    gradient[plane] += shear
    stress = cube(law).stress(gradient)
    assert stress[plane] == pytest.approx(law.shear0 * shear, rel=1e-3)
    assert stress[plane[::-1]] == pytest.approx(law.shear0 * shear, rel=1e-3)


def test_large_shear_of_the_neo_hookean_law_is_linear(cube: MakeCube) -> None:
    """Under a shear of 2, a neo-Hookean cube has mu times the shear as shear stress (Rivlin)."""
    law = NeoHookean(young=1e5, poisson=0.3)
    gradient = np.eye(3)
    gradient[0, 1] = 2.0
    assert cube(law).stress(gradient)[0, 1] == pytest.approx(2.0 * law.shear0, rel=1e-9)


def test_small_tension_has_youngs_modulus_and_poissons_ratio(law: Material, cube: MakeCube) -> None:
    """Under a strain of 1e-5 with lateral strain -nu 1e-5, the stress is E0 times the strain, and zero across."""
    strain = 1e-5
    lateral = 1.0 - law.poisson * strain
    stress = cube(law).stress(np.diag([1.0 + strain, lateral, lateral]))
    assert stress[0, 0] == pytest.approx(law.young0 * strain, rel=3e-3)
    assert abs(stress[1, 1]) < 3e-3 * law.young0 * strain


def test_energy_and_stress_do_not_depend_on_the_frame(law: Material, cube: MakeCube) -> None:
    """Rotating the deformed cube keeps the energy and rotates the stress (objectivity)."""
    gradient = np.array([[1.3, 0.4, -0.1], [0.2, 0.8, 0.3], [-0.2, 0.1, 1.1]])
    turn = Rotation.from_rotvec([1.0, -2.0, 0.5]).as_matrix()
    here, there = cube(law).stress(gradient), cube(law).stress(turn @ gradient)
    np.testing.assert_allclose(there, turn @ here, rtol=1e-8, atol=1e-9 * np.abs(here).max())
    assert cube(law).density(turn @ gradient) == pytest.approx(cube(law).density(gradient), rel=1e-10)


def test_material_has_no_direction(law: Material, cube: MakeCube) -> None:
    """Rotating the cube before its deformation keeps the energy (isotropy)."""
    gradient = np.array([[1.3, 0.4, -0.1], [0.2, 0.8, 0.3], [-0.2, 0.1, 1.1]])
    turn = Rotation.from_rotvec([1.0, -2.0, 0.5]).as_matrix()
    assert cube(law).density(gradient @ turn) == pytest.approx(cube(law).density(gradient), rel=1e-10)


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


def test_forces_scale_with_the_modulus(cube: MakeCube) -> None:
    """Doubling the modulus doubles energy and stress."""
    gradient = np.array([[1.3, 0.4, -0.1], [0.2, 0.8, 0.3], [-0.2, 0.1, 1.1]])
    for kind in (Linear, NeoHookean, StableNeoHookean):
        soft, hard = cube(kind(young=1e5, poisson=0.4)), cube(kind(young=2e5, poisson=0.4))
        assert hard.density(gradient) == pytest.approx(2.0 * soft.density(gradient), rel=1e-12)
        np.testing.assert_allclose(hard.stress(gradient), 2.0 * soft.stress(gradient), rtol=1e-9)


def test_the_pressure_term_meets_the_plain_law_at_moderate_poisson(cube: MakeCube) -> None:
    """Energy and stress are continuous at nu = 0.45, above which a pressure multiplier carries the volume energy."""
    gradient = np.array([[1.1, 0.2, 0.0], [0.1, 0.9, 0.1], [0.0, 0.1, 1.05]])
    for kind in (Linear, NeoHookean, StableNeoHookean):
        plain, carried = cube(kind(young=1e5, poisson=0.45)), cube(kind(young=1e5, poisson=0.45 + 1e-9))
        assert carried.density(gradient) == pytest.approx(plain.density(gradient), rel=1e-6)
        np.testing.assert_allclose(carried.stress(gradient), plain.stress(gradient), rtol=1e-6, atol=1e-3)

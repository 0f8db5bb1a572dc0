# SPDX-License-Identifier: Apache-2.0
"""Laws with a user's parameters: moduli, uniaxial curves, refused values."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gdfe_ros.materials import Curve, CurveData, Linear, Material, NeoHookean, Ogden

STRAINS = np.array([0.0, 0.01, 0.2, 0.7, 1.3, 2.5, 6.0])
POLYNOMIAL = CurveData.polynomial([1e5, -1e4])


def test_moduli_belong_together(law: Material) -> None:
    """E = 2 mu (1 + nu) and K = E / (3 (1 - 2 nu)) hold for every law."""
    assert law.young0 == pytest.approx(2.0 * law.shear0 * (1.0 + law.poisson), rel=1e-12)
    assert law.bulk == pytest.approx(law.young0 / (3.0 * (1.0 - 2.0 * law.poisson)), rel=1e-12)


def test_moduli_at_rest_are_the_given_ones() -> None:
    """The initial modulus is the given one: E, the sum of mu, or a third of the curve's initial slope."""
    assert Linear(young=2e5, poisson=0.3).young0 == 2e5
    assert NeoHookean(young=2e5, poisson=0.3).shear0 == pytest.approx(2e5 / 2.6)
    assert Ogden(mu=(1e5, -2e4), alpha=(1.5, -3.0), poisson=0.4).shear0 == pytest.approx(8e4)
    assert Curve(data=POLYNOMIAL, poisson=0.4).shear0 == pytest.approx(1e5 / 3.0)


def test_tangent_is_the_slope_of_the_stress(law: Material) -> None:
    """The tangent modulus equals a difference of stresses."""
    strain, step = STRAINS[1:] + 1e-3, 1e-6
    slope = (law.stress_at(strain + step) - law.stress_at(strain - step)) / (2.0 * step)
    np.testing.assert_allclose(law.tangent_at(strain), slope, rtol=1e-6, atol=1e-9 * law.young0)


@pytest.mark.parametrize("kind", [Linear, NeoHookean])
@pytest.mark.parametrize(
    ("name", "values", "message"),
    [
        ("poisson", [-1.0, 0.51, 0.7, math.nan, math.inf], r"must lie in -1 < poisson <= 0\.5, got .*incompressible"),
        ("young", [0.0, -1e5, math.nan, math.inf, 1e14], r" = .*: allowed is a number: 0 < .* \[Pa\] < 1e\+13"),
        ("density", [0.0, -1.0, math.nan, math.inf], r" = .*: allowed is .* density \[kg/m\^3\] < 1e\+06"),
        ("omega", [0.0, -0.1, 1.1, math.nan], r" = .*: allowed is a number: 0 < .* <= 1"),
    ],
)
def test_parameters_are_checked(kind: type[Linear], name: str, values: list[float], message: str) -> None:
    """A parameter out of its range is refused by name; a Poisson's ratio of 0.5 is incompressible."""
    for value in values:
        with pytest.raises(ValueError, match=f"{name}.*{message}"):
            kind(**{"young": 1e5, "poisson": 0.3, name: value})
    assert kind(young=1e5, poisson=0.5).bulk == math.inf


@pytest.mark.parametrize(
    ("mu", "alpha", "message"),
    [
        ((), (), "equal length of 1 to 6"),
        ((1e5,), (1.0, 2.0), "equal length of 1 to 6"),
        ((1e5,) * 7, (1.0,) * 7, "equal length of 1 to 6"),
        ((1e5,), (0.0,), "no alpha zero"),
        ((math.nan,), (1.0,), "finite"),
        ((1e5,), (math.inf,), "finite"),
        ((1e5,), (25.0,), r"alpha = .*: allowed is .*: -20 <= .* <= 20"),
        ((1e5, -2e5), (1.0, 2.0), "sum of mu"),
    ],
)
def test_ogden_terms_are_checked(mu: tuple[float, ...], alpha: tuple[float, ...], message: str) -> None:
    """Ogden terms that are missing, not finite or without initial stiffness are refused."""
    with pytest.raises(ValueError, match=message):
        Ogden(mu=mu, alpha=alpha, poisson=0.4)


def test_materials_are_values() -> None:
    """Two equal materials are equal and have the same hash."""
    first, second = (Ogden(mu=(1e5,), alpha=(2.0,), poisson=0.4) for _ in range(2))
    assert first == second
    assert len({first, second}) == 1
    with pytest.raises(AttributeError):
        first.poisson = 0.3

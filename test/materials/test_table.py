# SPDX-License-Identifier: Apache-2.0
"""Materials packed for the kernels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from gdfe_ros.materials import Curve, CurveData, Linear, Material, Ogden
from gdfe_ros.materials.table import carries_pressure

MakeCube = Callable[[Material], Any]


@pytest.mark.parametrize(("poisson", "carried"), [(-0.5, False), (0.3, False), (0.45, False), (0.46, True)])
def test_a_pressure_carries_the_volume_where_poissons_ratio_is_high(poisson: float, carried: bool) -> None:
    """Pressure multipliers are used only for ratios at which the bulk modulus makes the energy ill-conditioned."""
    assert carries_pressure(Linear(young=1e5, poisson=poisson)) is carried


@pytest.mark.parametrize("terms", [1, 2, 6])
def test_up_to_six_ogden_terms_count(cube: MakeCube, terms: int) -> None:
    """A modulus divided among several equal Ogden terms, up to six, has the same energy."""
    gradient = np.array([[1.3, 0.4, -0.1], [0.2, 0.8, 0.3], [-0.2, 0.1, 1.1]])
    one = Ogden(mu=(6e4,), alpha=(-3.0,), poisson=0.4)
    several = Ogden(mu=(6e4 / terms,) * terms, alpha=(-3.0,) * terms, poisson=0.4)
    assert cube(several).density(gradient) == pytest.approx(cube(one).density(gradient), rel=1e-12)


def test_polynomials_are_tabulated_without_loss(cube: MakeCube) -> None:
    """At 600 stretches up to 2.9, the kernel's stress is the polynomial's within 1e-8 of the initial modulus."""
    curve = CurveData.polynomial([8.67e6, -15.7e6, 15.02e6, -6.91e6, 1.53e6, -0.13e6], strain_max=2.0)
    body = cube(Curve(data=curve, poisson=0.4))
    for stretch in np.concatenate([np.linspace(1.0, 1.05, 100), np.linspace(1.05, 2.9, 500)]):
        stress = body.stress(np.diag([stretch, stretch**-0.5, stretch**-0.5]))
        nominal = stress[0, 0] - stress[1, 1] * stretch**-1.5
        assert abs(nominal - curve.stress_at(np.array(stretch - 1.0))) < 1e-8 * curve.initial_modulus


def test_curve_goes_on_beyond_the_tabulated_stretch(cube: MakeCube) -> None:
    """At 20 and 40 times the length, beyond the table, the stress still rises, without a jump at the table's end."""
    body = cube(Curve(data=CurveData.polynomial([1e5]), poisson=0.4))

    def tension(stretch: float) -> float:
        stress = body.stress(np.diag([stretch, stretch**-0.5, stretch**-0.5]))
        return stress[0, 0] - stress[1, 1] * stretch**-1.5

    assert tension(11.0 + 1e-6) == pytest.approx(tension(11.0 - 1e-6), rel=1e-5)
    assert tension(20.0) == pytest.approx(19e5, rel=1e-2)
    assert tension(40.0) > 1.9 * tension(20.0)

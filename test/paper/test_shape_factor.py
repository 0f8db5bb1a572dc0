# SPDX-License-Identifier: Apache-2.0
"""Shape factors of the relative policy: Eqs. 7 and 8."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros.paper.shape_factor import CALIBRATED_TO, geometric_ratio, shape_factors


def test_equation_seven_as_printed() -> None:
    """The geometric ratio is R_G = 0.0017 R_M^2 + 1.42245 R_M - 0.4141 (Eq. 7)."""
    ratio = np.array([1.0, 2.0, 10.0, 50.0])
    np.testing.assert_allclose(geometric_ratio(ratio), 0.0017 * ratio**2 + 1.42245 * ratio - 0.4141, rtol=1e-14)
    assert geometric_ratio(1.0) == pytest.approx(1.01005)


@pytest.mark.parametrize(
    ("mechanical", "geometric"), [(1.69, 2.0), (3.79, 5.0), (7.26, 10.0), (20.9, 30.0), (59.4, 90.0)]
)
def test_equation_seven_at_the_calibrated_ratios(mechanical: float, geometric: float) -> None:
    """The moduli ratios near those of Sec. 4.2.1 give its shape factor ratios."""
    assert geometric_ratio(mechanical) == pytest.approx(geometric, rel=5e-3)
    assert geometric <= CALIBRATED_TO


def test_equal_moduli_give_equal_factors() -> None:
    """With one material, every factor is about one half."""
    omega = shape_factors(np.full(7, 3e5))
    assert np.ptp(omega) == 0.0
    assert omega[0] == pytest.approx(0.5 / 1.01005)


def test_factors_do_not_depend_on_the_unit() -> None:
    """Moduli in MPa give the same factors as in Pa."""
    modulus = np.array([1e5, 3e5, 9e6])
    np.testing.assert_allclose(shape_factors(1e-6 * modulus), shape_factors(modulus), rtol=1e-14)


@pytest.mark.parametrize("contrast", [1.0, 1.5, 10.0, 1e3, 1e6])
def test_factors_lie_between_zero_and_one(contrast: float) -> None:
    """For moduli over up to six decades, 0 < omega <= 1, and a stiffer material has a larger omega."""
    modulus = np.geomspace(1e5, 1e5 * contrast, 20)
    omega = shape_factors(modulus)
    assert (omega > 0.0).all()
    assert (omega <= 1.0).all()
    assert (np.diff(omega) >= 0.0).all()

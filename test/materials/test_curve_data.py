# SPDX-License-Identifier: Apache-2.0
"""Uniaxial curves from coefficients and from measured tables, and their continuation beyond the data."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
import pytest

from gdfe_ros.materials import Curve, CurveData

STRAIN = np.array([0.0, 0.1, 0.3, 0.6, 1.0, 2.0])
STRESS = np.array([0.0, 2e5, 4e5, 5e5, 7e5, 15e5])
NINJAFLEX = (8.67e6, -15.7e6, 15.02e6, -6.91e6, 1.53e6, -0.13e6)


def test_polynomial_ends_where_its_tangent_turns_negative() -> None:
    """The data of e - e^2/4, whose tangent vanishes at e = 2, end just before that strain."""
    curve = CurveData.polynomial([1.0, -0.25])
    assert 1.99 < curve.strain_max <= 2.0
    assert (curve.tangent_at(np.linspace(0.0, 10.0, 100)) > 0.0).all()


@pytest.mark.parametrize(
    "curve",
    [CurveData.polynomial(NINJAFLEX, strain_max=2.0), CurveData.table(STRAIN, STRESS)],
    ids=["polynomial", "table"],
)
def test_curve_goes_on_as_a_straight_line(curve: CurveData) -> None:
    """Beyond the end of the data the stress continues with the slope at the end."""
    end = curve.strain_max
    assert end == 2.0
    below, above = curve.stress_at(np.array([end - 1e-9, end + 1e-9]))
    assert above == pytest.approx(below, rel=1e-7)
    assert curve.tangent_at(np.array(end + 1e-9)) == pytest.approx(curve.tangent_at(np.array(end - 1e-9)), rel=1e-6)
    assert curve.stress_at(np.array(52.0)) == pytest.approx(
        curve.stress_at(np.array(end)) + 50.0 * curve.tangent_at(np.array(end))
    )


def test_falling_end_of_the_data_is_replaced_by_the_last_rising_slope() -> None:
    """A curve measured past its peak continues beyond it with the last positive slope."""
    curve = CurveData.polynomial([1.0, -0.25], strain_max=3.0)
    assert curve.strain_max == 3.0
    assert curve.stress_at(np.array(2.0)) == pytest.approx(1.0, rel=1e-5)
    assert (curve.tangent_at(np.linspace(0.0, 10.0, 101)) > 0.0).all()
    assert (np.diff(curve.stress_at(np.linspace(0.0, 10.0, 101))) > 0.0).all()


def test_table_does_not_overshoot() -> None:
    """Between the points of a rising table the stress rises and stays between the points' stresses."""
    stress = CurveData.table(STRAIN, STRESS).stress_at(np.linspace(0.0, 2.0, 2001))
    assert (np.diff(stress) >= 0.0).all()
    assert stress.max() <= STRESS[-1]


def test_table_may_leave_out_the_origin() -> None:
    """A table that starts at the first loaded point gets the origin added."""
    assert CurveData.table(STRAIN[1:], STRESS[1:]) == CurveData.table(STRAIN, STRESS)


def test_sampled_polynomial_is_the_polynomial() -> None:
    """A polynomial written as a table of 200 rows has the polynomial's curve."""
    exact = CurveData.polynomial(NINJAFLEX, strain_max=2.0)
    e = np.linspace(0.0, 2.0, 200)
    table = CurveData.table(e, exact.stress_at(e))
    between = np.linspace(0.0, 3.0, 777)
    np.testing.assert_allclose(table.stress_at(between), exact.stress_at(between), rtol=2e-3)
    assert table.initial_modulus == pytest.approx(exact.initial_modulus, rel=1e-2)


def test_remarks_name_where_a_curve_softens() -> None:
    """A falling tangent and a negative stress are remarked with their strains; a sound curve has no remark."""
    assert CurveData.table(STRAIN, STRESS).remarks() == []
    falling = CurveData.polynomial([1.0, -0.25], strain_max=5.0).remarks()
    assert any("tangent modulus is negative from strain 2" in note for note in falling)
    assert any("stress is not positive at strain 4" in note for note in falling)


@pytest.mark.parametrize(
    ("coefficients", "strain_max", "message"),
    [
        *(
            (given, None, "coefficients must be finite and the first, the initial modulus, positive")
            for given in ([], [0.0], [-1.0, 2.0], [math.nan], [1.0, math.inf])
        ),
        *(([1.0], end, "strain_max must lie in 0 < strain_max <= 10") for end in (0.0, -1.0, 100.0, math.nan)),
    ],
)
def test_polynomials_are_checked(coefficients: list[float], strain_max: float | None, message: str) -> None:
    """Coefficients without initial stiffness, and an end of the data beyond the strains of any test, are refused."""
    with pytest.raises(ValueError, match=message):
        CurveData.polynomial(coefficients, strain_max=strain_max)


@pytest.mark.parametrize(
    ("strain", "stress", "message"),
    [
        ([0.0, 1.0], [0.0], "equal length"),
        ([[0.0], [1.0]], [[0.0], [1.0]], "columns"),
        ([0.0, math.nan], [0.0, 1.0], "finite"),
        ([0.0, 1.0, 0.5], [0.0, 1.0, 2.0], "ascend strictly from 0"),
        ([0.0, 1.0, 1.0], [0.0, 1.0, 2.0], "ascend strictly from 0"),
        ([-0.1, 1.0], [0.0, 1.0], "ascend strictly from 0"),
        ([0.0, 1.0], [0.5, 1.0], "where the stress is 0"),
        ([0.0], [0.0], "at least two points"),
        ([], [], "at least two points"),
        ([0.0, 0.5, 1.0], [0.0, -1.0, 1.0], "initial slope must be positive"),
    ],
)
def test_tables_are_checked(strain: list[float], stress: list[float], message: str) -> None:
    """Columns that are no uniaxial test are refused with the reason."""
    with pytest.raises(ValueError, match=message):
        CurveData.table(strain, stress)


@pytest.mark.parametrize(("strain", "told"), [(1.5, False), (1.6, True)])
def test_a_curve_beyond_the_strain_at_which_bars_become_ribbons_is_told(strain: float, *, told: bool) -> None:
    """Beyond a strain of 1.52, the equivalent strain of a bar in tension falls if its cross section becomes flat."""
    curve = Curve(data=CurveData.table([0.0, strain], [0.0, 1e5]), poisson=0.49)
    assert any("ribbon" in text for text in curve.remarks()) is told
    along, across = 1.0 + strain, np.array([1.0, 1.01, 1.0 / 1.01]) / np.sqrt(1.0 + strain)
    squares = [sum((a - b) ** 2 for a, b in combinations((along, *sides), 2)) for sides in (across[[0, 0]], across[1:])]
    assert bool(squares[1] < squares[0]) is told

# SPDX-License-Identifier: Apache-2.0
"""A uniaxial stress-strain curve: a polynomial or a measured table, continued beyond its data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from scipy.interpolate import PchipInterpolator

_SEARCH_TO = 10.0
_SAMPLES = 4001


@dataclass(frozen=True)
class CurveData:
    """Uniaxial nominal stress sigma(e) [Pa] as a function of the engineering strain e.

    Beyond ``strain_max`` the curve continues as a straight line (C1). If the tangent is not positive there, the line
    starts at the last strain with a positive tangent.

    Attributes:
        coefficients: coefficients of e, e^2, ... in this order [Pa]; empty for a table.
        strain: strains of a table (k,), ascending from 0; empty for a polynomial.
        stress: stresses of a table (k,) [Pa].
        strain_max: largest strain of the data.
    """

    coefficients: tuple[float, ...]
    strain: tuple[float, ...]
    stress: tuple[float, ...]
    strain_max: float

    @classmethod
    def polynomial(cls, coefficients: ArrayLike, *, strain_max: float | None = None) -> CurveData:
        """Return a polynomial curve.

        Its data end at ``strain_max``. If this is None, they end where the tangent stops being positive, or at strain
        10 if it never does.

        Raises:
            ValueError: a coefficient is not finite, the initial modulus is not positive, or ``strain_max`` is out of
                range.
        """
        values = tuple(float(value) for value in np.atleast_1d(np.asarray(coefficients, dtype=np.float64)))
        if not values or not np.isfinite(values).all() or values[0] <= 0.0:
            raise ValueError(f"coefficients must be finite and the first, the initial modulus, positive: {values!r}")
        if strain_max is not None and not 0.0 < strain_max <= _SEARCH_TO:
            raise ValueError(f"strain_max must lie in 0 < strain_max <= {_SEARCH_TO:g}, got {strain_max!r}")
        curve = cls(values, (), (), strain_max or _SEARCH_TO)
        if strain_max is None:
            grid = np.linspace(0.0, _SEARCH_TO, _SAMPLES)
            falling = np.flatnonzero(curve._data_tangent(grid) <= 0.0)
            if falling.size:
                curve = cls(values, (), (), float(grid[falling[0] - 1]))
        return curve

    @classmethod
    def table(cls, strain: ArrayLike, stress: ArrayLike) -> CurveData:
        """Return a curve through measured points (monotone cubic interpolation, Fritsch and Carlson 1980).

        Raises:
            ValueError: there are fewer than two points, the lengths differ, a number is not finite, the strains do not
                ascend from 0, the stress at strain 0 is not 0, or the initial slope is not positive.
        """
        e, s = np.asarray(strain, dtype=np.float64), np.asarray(stress, dtype=np.float64)
        if e.ndim != 1 or e.shape != s.shape or not (np.isfinite(e).all() and np.isfinite(s).all()):
            raise ValueError("strain and stress must be finite columns of equal length")
        if e.size and e[0] > 0.0:
            e, s = np.insert(e, 0, 0.0), np.insert(s, 0, 0.0)
        if e.size < 2 or e[0] != 0.0 or s[0] != 0.0 or (np.diff(e) <= 0.0).any():
            raise ValueError("strain must ascend strictly from 0, where the stress is 0, with at least two points")
        curve = cls((), tuple(e.tolist()), tuple(s.tolist()), float(e[-1]))
        if curve.initial_modulus <= 0.0:
            raise ValueError(f"the initial slope must be positive, got {curve.initial_modulus:g} Pa")
        return curve

    @property
    def initial_modulus(self) -> float:
        """Initial Young's modulus [Pa]."""
        return float(self._data_tangent(np.zeros(1))[0])

    def stress_at(self, strain: ArrayLike) -> NDArray[np.float64]:
        """Return the nominal stress [Pa] at engineering strains (any shape, >= 0)."""
        e = np.asarray(strain, dtype=np.float64)
        end, slope = self._continuation()
        inside = self._data_stress(np.minimum(e, end))
        return np.where(e <= end, inside, self._data_stress(np.array(end)) + slope * (e - end))

    def tangent_at(self, strain: ArrayLike) -> NDArray[np.float64]:
        """Return the tangent modulus d sigma / d e [Pa] at engineering strains (any shape, >= 0)."""
        e = np.asarray(strain, dtype=np.float64)
        end, slope = self._continuation()
        return np.where(e <= end, self._data_tangent(np.minimum(e, end)), slope)

    def scale_stress(self, factor: float) -> CurveData:
        """Return the curve with every stress times a factor."""
        coefficients = tuple(factor * value for value in self.coefficients)
        return CurveData(coefficients, self.strain, tuple(factor * value for value in self.stress), self.strain_max)

    def remarks(self) -> list[str]:
        """Return remarks on strains at which the tangent is negative or the stress not positive; empty if none."""
        grid = np.linspace(0.0, self.strain_max, _SAMPLES)
        tangent, stress = self._data_tangent(grid), self._data_stress(grid)
        notes = []
        if (tangent < 0.0).any():
            notes.append(f"the tangent modulus is negative from strain {grid[np.argmax(tangent < 0.0)]:.3g} on")
        if (stress[1:] <= 0.0).any():
            notes.append(f"the stress is not positive at strain {grid[1:][np.argmax(stress[1:] <= 0.0)]:.3g}")
        return notes

    def _continuation(self) -> tuple[float, float]:
        """Return the strain at which the straight continuation of the curve starts, and its slope [Pa]."""
        slope = float(self._data_tangent(np.array([self.strain_max]))[0])
        if slope > 0.0:
            return self.strain_max, slope
        grid = np.linspace(0.0, self.strain_max, _SAMPLES)
        rising = np.flatnonzero(self._data_tangent(grid) > 0.0)
        end = float(grid[rising[-1]])
        return end, float(self._data_tangent(np.array([end]))[0])

    def _data_stress(self, strain: NDArray[np.float64]) -> NDArray[np.float64]:
        if self.coefficients:
            return np.polynomial.polynomial.polyval(strain, (0.0, *self.coefficients))
        return self._interpolation()(strain)

    def _data_tangent(self, strain: NDArray[np.float64]) -> NDArray[np.float64]:
        if self.coefficients:
            slopes = np.arange(1, len(self.coefficients) + 1) * self.coefficients
            return np.polynomial.polynomial.polyval(strain, slopes)
        return self._interpolation().derivative()(strain)

    def _interpolation(self) -> PchipInterpolator:
        from scipy.interpolate import PchipInterpolator  # takes a tenth of a second, and most scenes do not need it

        return PchipInterpolator(self.strain, self.stress)

# SPDX-License-Identifier: Apache-2.0
"""Data of a material of the library."""

from __future__ import annotations

from dataclasses import dataclass

from gdfe_ros.materials.curve_data import CurveData


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """A material's constants and their source.

    Attributes:
        mu: moduli of Ogden's law [Pa].
        alpha: exponents of Ogden's law.
        curve: nominal stress as a function of engineering strain, up to the largest measured strain.
        source: authors and method of the measurement.
        poisson: initial Poisson's ratio; None if the source does not give it.
        density: mass density [kg/m^3]; None if the source does not give it.
        misfit: largest relative deviation of Ogden's law from the data; None if unknown.
        caveat: limitation that a user must know; empty if there is none.
    """

    mu: tuple[float, ...]
    alpha: tuple[float, ...]
    curve: CurveData
    source: str
    poisson: float | None = None
    density: float | None = None
    misfit: float | None = None
    caveat: str = ""

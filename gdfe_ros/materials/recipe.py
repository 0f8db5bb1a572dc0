# SPDX-License-Identifier: Apache-2.0
"""What is known of a material of the library."""

from __future__ import annotations

from dataclasses import dataclass

from gdfe_ros.materials.curve_data import CurveData


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """A material's constants and where they come from.

    Attributes:
        mu: moduli of Ogden's law [Pa].
        alpha: exponents of Ogden's law.
        curve: nominal stress against engineering strain; it ends where the data end.
        source: who measured it, and how.
        poisson: Poisson's ratio at rest; None where nobody told it.
        density: mass density [kg/m^3]; None where nobody told it.
        misfit: largest difference of Ogden's law from the data, over their stress.
        caveat: what a user must know; empty where nothing is.
    """

    mu: tuple[float, ...]
    alpha: tuple[float, ...]
    curve: CurveData
    source: str
    poisson: float | None = None
    density: float | None = None
    misfit: float | None = None
    caveat: str = ""

# SPDX-License-Identifier: Apache-2.0
"""Energies of the laws, written again from their docstrings and docs/theory/energy.md."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

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

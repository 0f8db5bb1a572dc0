# SPDX-License-Identifier: Apache-2.0
"""The stable neo-Hookean law of the public benchmark (Smith, de Goes and Kim 2018) with numpy, for whole arrays of F.

psi = mu/2 (I1 - 3) - mu/2 ln((I1 + 1)/4) - 3 mu/4 (J - 1) + lambda/2 (J - 1)^2 is the benchmark's energy without its
constant. F and P are rows (..., 9).
"""

from __future__ import annotations

from itertools import permutations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
IDENTITY = np.eye(3).ravel()
_SIGN = np.zeros((3, 3, 3))
for _place in permutations(range(3)):
    _SIGN[_place] = np.linalg.det(np.eye(3)[list(_place)])
_MINORS = np.einsum("ikm,JLM->mMiJkL", _SIGN, _SIGN).reshape(9, 81)
"""The derivative of cof F with respect to F is a linear function of F with this matrix."""


def density(f: Array, mu: float, lame: float) -> Array:
    """Return psi (...) [J/m^3]."""
    first, change = (f * f).sum(-1), volume_ratio(f) - 1.0
    return 0.5 * mu * (first - 3.0 - np.log(0.25 * (first + 1.0)) - 1.5 * change) + 0.5 * lame * change**2


def volume_ratio(f: Array) -> Array:
    """Return J = det F (...)."""
    return np.linalg.det(f.reshape(*f.shape[:-1], 3, 3))


def stress(f: Array, mu: float, lame: float) -> Array:
    """Return P = dpsi/dF (..., 9) [Pa]."""
    return tangent(f, mu, lame)[0]


def tangent(f: Array, mu: float, lame: float) -> tuple[Array, Array]:
    """Return P (..., 9) and dP/dF (..., 9, 9) [Pa]."""
    minors = (f @ _MINORS).reshape(*f.shape, 9)
    cofactor = 0.5 * (minors @ f[..., None])[..., 0]
    above = ((f * f).sum(-1) + 1.0)[..., None]
    pressure = (lame * ((cofactor * f).sum(-1) / 3.0 - 1.0) - 0.75 * mu)[..., None]
    slope = mu * (1.0 - 1.0 / above)
    hessian = pressure[..., None] * minors + slope[..., None] * np.eye(9)
    hessian += lame * cofactor[..., :, None] * cofactor[..., None, :]
    hessian += (2.0 * mu / above**2)[..., None] * f[..., :, None] * f[..., None, :]
    return slope * f + pressure * cofactor, hessian


def positive_part(hessian: Array) -> Array:
    """Return the matrices (..., 9, 9) with their negative eigenvalues replaced by zero (the filter *clamp*)."""
    values, vectors = np.linalg.eigh(hessian)
    return (vectors * np.maximum(values, 0.0)[..., None, :]) @ np.swapaxes(vectors, -1, -2)

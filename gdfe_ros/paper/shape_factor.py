# SPDX-License-Identifier: Apache-2.0
"""Shape factors of the ``relative`` policy: the paper's Algorithm 1 with the calibration of Eq. 7."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

CALIBRATION = (-0.4141, 1.42245, 0.0017)
"""Eq. 7, R_G = 0.0017 R_M^2 + 1.42245 R_M - 0.4141, coefficients ascending."""
CALIBRATED_TO = 90.0
"""Largest ratio of shape factors for which Eq. 7 was calibrated (paper, Sec. 4.2.1)."""
LARGEST_RATIO = 1e3
"""Largest ratio of moduli that shape factors represent; omega would be below 4e-4 for larger ratios."""


def geometric_ratio(mechanical_ratio: ArrayLike) -> NDArray[np.float64]:
    """Return the ratio of shape factors R_G for a ratio of moduli R_M >= 1 (Eq. 7)."""
    return np.polynomial.polynomial.polyval(np.asarray(mechanical_ratio, dtype=np.float64), CALIBRATION)


def shape_factors(modulus: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return omega (m,) of elements with tangent moduli (m,) [Pa] (Eqs. 7 and 8).

    omega_i = h / R_G(E_max / E_i), h = r / (r + 1), r = E_max / E_min. A modulus below E_max / ``LARGEST_RATIO`` is
    raised to this value; an example is the negative tangent of a falling curve.
    """
    stiffest = modulus.max()
    modulus = np.maximum(modulus, stiffest / LARGEST_RATIO)
    ratio = stiffest / modulus.min()
    return ratio / (ratio + 1.0) / geometric_ratio(stiffest / modulus)


def calibration_remarks(modulus: NDArray[np.float64]) -> list[str]:
    """Return a remark if the initial moduli (k,) [Pa] need shape factors beyond the calibration of Eq. 7."""
    ratio = float(modulus.max() / modulus.min())
    needed = float(geometric_ratio(ratio))
    if needed <= CALIBRATED_TO:
        return []
    return [
        f"moduli at rest differ by a factor of {ratio:.3g}: the shape factors' ratio of {needed:.3g} lies beyond the "
        f"calibration of the policy 'relative' (Eq. 7, up to {CALIBRATED_TO:g}); remedy: policy: energy"
    ]

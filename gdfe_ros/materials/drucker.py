# SPDX-License-Identifier: Apache-2.0
"""Drucker's stability condition for incompressible laws in principal stretches: the tangent is positive definite."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
STRETCHES = np.concatenate([np.geomspace(0.3, 1.0, 121), np.geomspace(1.0, 3.0, 121)[1:]])
"""First principal stretches at which the stability of a law is checked."""
MODES: dict[str, Callable[[NDArray[np.float64]], tuple[NDArray[np.float64], ...]]] = {
    "uniaxial": lambda stretch: (stretch, stretch**-0.5, stretch**-0.5),
    "equibiaxial": lambda stretch: (stretch, stretch, stretch**-2.0),
    "planar": lambda stretch: (stretch, np.ones_like(stretch), 1.0 / stretch),
}
"""Dict from the name of a deformation to the three principal stretches as functions of the first stretch."""


Hessian = Callable[[Vector, Vector, Vector], tuple[Vector, Vector, Vector]]
"""Function of three principal stretches with l1 l2 l3 = 1 that returns the entries 11, 12 and 22 of the Hessian [Pa] of
the energy with respect to ln l1 and ln l2.
"""


def drucker_remarks(hessian: Hessian) -> list[str]:
    """Return remarks on stretches at which the tangent stiffness is not positive definite; empty if there are none.

    Each deformation of `MODES` is checked in tension and in compression. The Kirchhoff stresses of an incompressible
    body obey d(tau_1 - tau_3) = h11 d ln l1 + h12 d ln l2 and d(tau_2 - tau_3) = h12 d ln l1 + h22 d ln l2. The law is
    stable if the matrix h is positive definite.

    Args:
        hessian: Hessian of the law's energy.
    """
    notes = []
    for mode, stretches in MODES.items():
        first, mixed, second = hessian(*stretches(STRETCHES))
        stable = (first > 0.0) & (first * second - mixed**2 > 0.0)
        for what, side in (("tension", STRETCHES >= 1.0), ("compression", STRETCHES <= 1.0)):
            lost = STRETCHES[side & ~stable]
            if len(lost):
                worst = lost.min() if what == "tension" else lost.max()
                notes.append(
                    f"unstable in {mode} {what} from stretch {worst:.3g} on (Drucker); remedy: fit the constants with "
                    "data of that deformation, or avoid it"
                )
    return notes


def separable_hessian(stiffness: Callable[[Vector], Vector]) -> Hessian:
    """Return the Hessian of an energy that is a sum over the principal stretches; a(l) = d tau / d ln l [Pa]."""

    def hessian(one: Vector, two: Vector, three: Vector) -> tuple[Vector, Vector, Vector]:
        first, second, third = map(stiffness, (one, two, three))
        return first + third, third, second + third

    return hessian


def invariant_hessian(slopes: Callable[[Vector], tuple[Vector, Vector]]) -> Hessian:
    """Return the Hessian of an energy W(I1); ``slopes`` returns dW/dI1 and d2W/dI1^2 [Pa] at I1 - 3."""

    def hessian(one: Vector, two: Vector, three: Vector) -> tuple[Vector, Vector, Vector]:
        a, b, c = one**2, two**2, three**2
        first, second = slopes(a + b + c - 3.0)
        u, v = 2.0 * (a - c), 2.0 * (b - c)
        return (
            second * u * u + 4.0 * first * (a + c),
            second * u * v + 4.0 * first * c,
            (second * v * v + 4.0 * first * (b + c)),
        )

    return hessian

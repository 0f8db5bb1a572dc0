# SPDX-License-Identifier: Apache-2.0
"""Drucker's stability condition for incompressible laws in principal stretches: the tangent is positive definite."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

STRETCHES = np.concatenate([np.geomspace(0.3, 1.0, 121), np.geomspace(1.0, 3.0, 121)[1:]])
"""First principal stretches at which the stability of a law is checked."""
MODES: dict[str, Callable[[NDArray[np.float64]], tuple[NDArray[np.float64], ...]]] = {
    "uniaxial": lambda stretch: (stretch, stretch**-0.5, stretch**-0.5),
    "equibiaxial": lambda stretch: (stretch, stretch, stretch**-2.0),
    "planar": lambda stretch: (stretch, np.ones_like(stretch), 1.0 / stretch),
}
"""Dict from the name of a deformation to the three principal stretches as functions of the first stretch."""


def drucker_remarks(stiffness: Callable[[NDArray[np.float64]], NDArray[np.float64]]) -> list[str]:
    """Return remarks on stretches at which the tangent stiffness is not positive definite; empty if there are none.

    Each deformation of `MODES` is checked in tension and in compression. With d tau_i / d ln l_i = a_i, the Kirchhoff
    stresses of an incompressible body obey d tau_1 = (a_1 + a_3) d ln l_1 + a_3 d ln l_2, and the same with 1 and 2
    exchanged. The law is stable if the 2 x 2 matrix of this relation is positive definite.

    Args:
        stiffness: function a(l) = d tau / d ln l [Pa] of principal stretches l. The law's energy must be a sum over the
            principal stretches.
    """
    notes = []
    for mode, stretches in MODES.items():
        first, second, third = (stiffness(stretch) for stretch in stretches(STRETCHES))
        stable = (first + third > 0.0) & (first * second + third * (first + second) > 0.0)
        for what, side in (("tension", STRETCHES >= 1.0), ("compression", STRETCHES <= 1.0)):
            lost = STRETCHES[side & ~stable]
            if len(lost):
                worst = lost.min() if what == "tension" else lost.max()
                notes.append(
                    f"unstable in {mode} {what} from stretch {worst:.3g} on (Drucker); remedy: fit the constants with "
                    "data of that deformation, or avoid it"
                )
    return notes

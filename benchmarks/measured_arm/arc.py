# SPDX-License-Identifier: Apache-2.0
"""Comparison of the arm's recordings with an arc of constant length, in a measurement frame that may be rotated.

If an arc of length L ends at the angle t, its tip has moved by L (1 - cos t) / t laterally and by L (1 - sin t / t)
towards the base. The length of this displacement does not depend on the frame of the measurement; its direction does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def arc(tilt: Array, length: float) -> tuple[Array, Array]:
    """Return the axial and the lateral tip displacement (k,) [m] of arcs; axial is negative towards the base.

    Args:
        tilt: angle at the end of the arc (k,) [rad], positive.
        length: length of the arc [m].
    """
    return -length * (1.0 - np.sin(tilt) / tilt), length * (1.0 - np.cos(tilt)) / tilt


def turned(axial: Array, lateral: Array, tilt: Array, length: float) -> tuple[Array, Array]:
    """Return the ratio of the measured displacement to the arc's (k,), and the angle between both (k,) [rad]."""
    along, aside = arc(tilt, length)
    ratio = np.hypot(axial, lateral) / np.hypot(along, aside)
    return ratio, np.arctan2(-axial, lateral) - np.arctan2(-along, aside)

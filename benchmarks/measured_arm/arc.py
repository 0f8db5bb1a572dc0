# SPDX-License-Identifier: Apache-2.0
"""What the recordings of the arm say without any model: an arc of constant length, seen in a frame that is turned.

An arc of length L that ends at the angle t has moved its tip by L (1 - cos t) / t to the side and by L (1 - sin t / t)
towards the base. Its total path length does not depend on the frame in which it is seen; the direction does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def arc(tilt: Array, length: float) -> tuple[Array, Array]:
    """Return the axial (negative: towards the base) and the lateral displacement (k,) [m] of arcs that end at ``tilt``.

    Args:
        tilt: (k,) [rad], positive.
        length: of the arc [m].
    """
    return -length * (1.0 - np.sin(tilt) / tilt), length * (1.0 - np.cos(tilt)) / tilt


def turned(axial: Array, lateral: Array, tilt: Array, length: float) -> tuple[Array, Array]:
    """Return the measured path length over the arc's (k,), and the angle (k,) [rad] between the two directions."""
    along, aside = arc(tilt, length)
    ratio = np.hypot(axial, lateral) / np.hypot(along, aside)
    return ratio, np.arctan2(-axial, lateral) - np.arctan2(-along, aside)

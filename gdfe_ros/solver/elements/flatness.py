# SPDX-License-Identifier: Apache-2.0
"""Messages about flat or folded elements."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gdfe_ros.mesh.quality import list_ids
from gdfe_ros.solver.elements.barrier import THRESHOLD


def flattened(least: NDArray[np.float64]) -> str:
    """Return a message that lists the flat or folded elements; empty if there are none.

    Args:
        least: (m,) least volume ratio at a corner of each element.
    """
    folded, flat = np.flatnonzero(~(least > 0.0)), np.flatnonzero(least < THRESHOLD)
    found = folded if len(folded) else flat[np.argsort(least[flat], kind="stable")]
    if not len(found):
        return ""
    what = "folded or turned inside out" if len(folded) else "pressed flat at a corner"
    return f"elements {what} (least volume ratio {least[found].min():.3g}): {list_ids(found)}"

# SPDX-License-Identifier: Apache-2.0
"""How far a minimisation has yet to go, judged by how fast its steps shrink.

One short step proves nothing: where the constant matrix takes a soft mode for stiff, the steps are short and many.
"""

from __future__ import annotations

from gdfe_ros.compiled import internal, kernel
from gdfe_ros.solver.descent import DISTANCE, FLAT, RING, SEEN, WINDOW

ALIGNED = 0.3
"""Share of the steps to come that adds up: they point one way and another."""
LONGEST_WAY = 10.0
"""Way left, over the target of a step, with which a minimisation may end."""
SLOWEST = 0.95
"""Largest factor from window to window that is believed."""


@internal
def note_step(descent):
    """Put the displacement of the step to come into the ring."""
    seen = int(descent.status[SEEN])
    if seen >= 0:
        descent.status[RING + seen % (2 * WINDOW)] = descent.status[DISTANCE]
        descent.status[SEEN] = seen + 1


@kernel
def way_left(descent):
    """Estimate the displacement [m] of all steps to come from how fast they shrink; 0 while too few were seen.

    It is also 0 where a window has not lowered the energy by more than its rounding: what moves there is noise.
    """
    seen = int(descent.status[SEEN])
    if seen < 2 * WINDOW or descent.status[FLAT] >= WINDOW:
        return 0.0
    recent, before = 0.0, 0.0
    for i in range(WINDOW):
        recent = max(recent, descent.status[RING + (seen - 1 - i) % (2 * WINDOW)])
        before = max(before, descent.status[RING + (seen - 1 - i - WINDOW) % (2 * WINDOW)])
    rate = min(recent / max(before, 1e-300), SLOWEST)
    return ALIGNED * WINDOW * recent * rate / (1.0 - rate)

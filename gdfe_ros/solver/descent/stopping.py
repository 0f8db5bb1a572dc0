# SPDX-License-Identifier: Apache-2.0
"""How far a minimisation has yet to go, judged by how fast its steps shrink.

One short step proves nothing: where the constant matrix takes a soft mode for stiff, the steps are short and many.
"""

from __future__ import annotations

from gdfe_ros.compiled import internal, kernel
from gdfe_ros.solver.descent.workspace import WINDOW

LONGEST_WAY = 10.0
"""Way left, over the target of a step, with which a minimisation may end."""
SLOWEST = 0.95
"""Largest factor from window to window that is believed."""


@internal
def note_step(work):
    """Put the displacement of the step to come into the ring."""
    status = work.status[0]
    if status.seen >= 0:
        work.recent[status.seen % (2 * WINDOW)] = status.distance
        status.seen += 1


@kernel
def way_left(work):
    """Estimate the displacement [m] of all steps to come from how fast they shrink; 0 while too few were seen.

    They may all point one way: a third of their sum ended cold solves up to 3.4 tolerances away.

    It is also 0 where a window has not lowered the energy by more than its rounding: what moves there is noise.
    """
    status = work.status[0]
    if status.seen < 2 * WINDOW or status.plateau >= WINDOW:
        return 0.0
    latest, before = 0.0, 0.0
    for i in range(WINDOW):
        latest = max(latest, work.recent[(status.seen - 1 - i) % (2 * WINDOW)])
        before = max(before, work.recent[(status.seen - 1 - i - WINDOW) % (2 * WINDOW)])
    rate = min(latest / max(before, 1e-300), SLOWEST)
    return WINDOW * latest * rate / (1.0 - rate)

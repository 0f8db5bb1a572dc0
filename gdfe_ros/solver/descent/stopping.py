# SPDX-License-Identifier: Apache-2.0
"""Remaining distance of a minimisation, estimated from the rate at which its steps shrink.

One short step proves nothing: if the constant matrix makes a soft mode too stiff, steps are short and many.
"""

from __future__ import annotations

from gdfe_ros.compiled import internal, kernel
from gdfe_ros.solver.descent.workspace import WINDOW

LONGEST_WAY = 5.0
"""Largest estimated remaining distance at which a minimisation may end, divided by its target for one step."""
SLOWEST = 0.95
"""Upper limit, in the estimate, of the ratio of the longest steps of two successive windows."""


@internal
def note_step(work):
    """Store the largest displacement of the next step in the ring buffer."""
    status = work.status[0]
    if status.seen >= 0:
        work.recent[status.seen % (2 * WINDOW)] = status.distance
        status.seen += 1


@kernel
def way_left(work):
    """Return the estimated displacement [m] of all remaining steps, from the rate at which the last steps shrank.

    The lengths of the steps are summed, because all steps may have one direction. (With a third of the sum, cold solves
    ended up to 3.4 tolerances from the equilibrium.) The estimate is 0 while too few steps are recorded. It is 0, too,
    if the steps of a window lowered the energy by no more than rounding: such motion is noise.
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

# SPDX-License-Identifier: Apache-2.0
"""Two soft pads that squeeze a rigid box, as plain numbers for every solver."""

from __future__ import annotations

PAD, CELLS = (0.035, 0.03, 0.03), (7, 3, 3)
"""Size of a pad [m], and its cells."""
SPAN = 0.10
"""From the outer face of one pad to that of the other [m]."""
YOUNG, POISSON, DENSITY = 2.0e5, 0.45, 1000.0
"""Of the pads [Pa], [kg/m^3]."""
BOX, BOX_DENSITY = (0.02, 0.05, 0.05), 640.0
"""Size [m] and density [kg/m^3] of what is held."""
WEIGHT, SQUEEZE, GRAVITY = 640.0 * 0.02 * 0.05 * 0.05 * 9.81, 0.0065, 9.81
"""Of what is held [N], by how far each pad comes nearer [m], and [m/s^2]."""
STEP = 0.005
"""Of all solvers [s]."""
STAGES = (("squeeze", 0.3), ("settle", 0.2), ("load", 0.8), ("rest", 0.3))
"""What is done before the box is watched, and for how long [s]."""

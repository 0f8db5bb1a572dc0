# SPDX-License-Identifier: Apache-2.0
"""Two soft pads on actuated prismatic joints that press a rigid box by a force, as plain numbers for every solver."""

from __future__ import annotations

PAD, CELLS = (0.01, 0.03, 0.03), (2, 6, 6)
"""Size of a pad [m], and its cells."""
YOUNG, POISSON, DENSITY = 1.0e5, 0.4, 1000.0
"""Of the pads [Pa], [kg/m^3]."""
BOX, BOX_MASS = (0.04, 0.04, 0.04), 0.05
"""Size [m] and mass [kg] of what is held."""
PADDLE_MASS, SQUEEZE, GAP = 0.05, 3.0, 0.0005
"""Mass of what carries a pad [kg], its force [N], and the gap to the box at the beginning [m]."""
STEP = 0.005
"""Of all solvers [s]."""

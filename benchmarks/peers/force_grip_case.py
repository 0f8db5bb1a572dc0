# SPDX-License-Identifier: Apache-2.0
"""Two soft pads on prismatic joints that press a rigid box with a given force, as plain numbers for every solver."""

from __future__ import annotations

PAD, CELLS = (0.01, 0.03, 0.03), (2, 6, 6)
"""Size of a pad [m], and its numbers of cells."""
YOUNG, POISSON, DENSITY = 1.0e5, 0.4, 1000.0
"""Young's modulus [Pa], Poisson's ratio and density [kg/m^3] of the pads."""
BOX, BOX_MASS = (0.04, 0.04, 0.04), 0.05
"""Size [m] and mass [kg] of the box."""
PADDLE_MASS, SQUEEZE, GAP = 0.05, 3.0, 0.0005
"""Mass of each paddle that carries a pad [kg], force on it [N], and initial gap between pad and box [m]."""
STEP = 0.005
"""Time step of all solvers [s]."""

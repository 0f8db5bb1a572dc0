# SPDX-License-Identifier: Apache-2.0
"""Two soft pads that squeeze a rigid box, as plain numbers for every solver."""

from __future__ import annotations

PAD, CELLS = (0.035, 0.03, 0.03), (7, 3, 3)
"""Size of a pad [m], and its numbers of cells."""
SPAN = 0.10
"""Distance between the outer faces of the two pads [m]."""
YOUNG, POISSON, DENSITY = 2.0e5, 0.45, 1000.0
"""Young's modulus [Pa], Poisson's ratio and density [kg/m^3] of the pads."""
BOX, BOX_DENSITY = (0.02, 0.05, 0.05), 640.0
"""Size [m] and density [kg/m^3] of the box."""
WEIGHT, SQUEEZE, GRAVITY = 640.0 * 0.02 * 0.05 * 0.05 * 9.81, 0.0065, 9.81
"""Weight of the box [N], inward displacement of each pad [m], and gravity [m/s^2]."""
STEP = 0.005
"""Time step of all solvers [s]."""
STAGES = (("squeeze", 0.3), ("settle", 0.2), ("load", 0.8), ("rest", 0.3))
"""Stages before the hold, and their durations [s]."""

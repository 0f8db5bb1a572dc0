# SPDX-License-Identifier: Apache-2.0
"""Compiled minimisation: unknowns and workspace, and the loop of L-BFGS around a tangent that turns with the body."""

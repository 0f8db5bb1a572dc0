# SPDX-License-Identifier: Apache-2.0
"""Minimisation of the potential: L-BFGS around a tangent that turns with the body."""

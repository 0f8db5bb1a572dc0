# SPDX-License-Identifier: Apache-2.0
"""The factored tangent stiffness: preconditioner of slender bodies, and estimate of their distance to equilibrium."""

# SPDX-License-Identifier: Apache-2.0
"""The factored tangent stiffness: preconditioner of a solve, and proof that an equilibrium is a minimum."""

# SPDX-License-Identifier: Apache-2.0
"""The tangent stiffness at a shape, factored: what preconditions slender bodies, and tells how far they have to go."""

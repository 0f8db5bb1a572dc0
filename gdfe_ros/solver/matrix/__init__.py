# SPDX-License-Identifier: Apache-2.0
"""The unknowns of a body, its constant matrix, and the factor of its tangent, which turns with the body."""

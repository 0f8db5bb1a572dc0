# SPDX-License-Identifier: Apache-2.0
"""Minimiser of a body: the tangent that it keeps, products with the present one, and its softest direction."""

# SPDX-License-Identifier: Apache-2.0
"""Minimiser of a body's potential: its kept tangent, products with the present tangent, and the softest direction."""

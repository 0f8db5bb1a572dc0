# SPDX-License-Identifier: Apache-2.0
"""Equilibria of both policies: prediction, minimisation, multiplier updates, stability; the paper's own solver."""

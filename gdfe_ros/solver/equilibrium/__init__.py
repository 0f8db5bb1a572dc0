# SPDX-License-Identifier: Apache-2.0
"""Equilibria of the policy ``energy``: prediction, minimisation, multiplier updates, and stability."""

# SPDX-License-Identifier: Apache-2.0
"""Equilibrium solver of the policy ``energy``: prediction, minimisation, multiplier updates, stability."""

# SPDX-License-Identifier: Apache-2.0
"""From a state and a command to the equilibrium: prediction, what is left out, descents, multipliers in between."""

# SPDX-License-Identifier: Apache-2.0
"""From one equilibrium to the next: increments, prediction, verdicts, dormancy, sensitivities."""

# SPDX-License-Identifier: Apache-2.0
"""Steps from one equilibrium to the next: increments, verdicts, restarts."""

# SPDX-License-Identifier: Apache-2.0
"""Parts of `Simulation`: readings, teleports, stored states, and the choice of its stepper."""

# SPDX-License-Identifier: Apache-2.0
"""The parts of `Simulation`: what it reads, teleports, and the choice of its stepper."""

# SPDX-License-Identifier: Apache-2.0
"""Measurements of the node's own cost, in separate processes over Fast DDS: ``make bench-node``."""

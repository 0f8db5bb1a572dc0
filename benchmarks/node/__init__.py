# SPDX-License-Identifier: Apache-2.0
"""What the node itself costs, in real processes over Fast DDS: ``make bench-node``."""

# SPDX-License-Identifier: Apache-2.0
"""Run time against error: the paper's scenes, reference solutions, peers and the comparison."""

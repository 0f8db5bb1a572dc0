# SPDX-License-Identifier: Apache-2.0
"""Benchmarks: run time against error on the paper's scenes, with reference solutions and other solvers (peers)."""

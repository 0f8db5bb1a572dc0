# SPDX-License-Identifier: Apache-2.0
"""The geometry-driven solver: local step, constant global matrix, equilibrium. Knows no ROS and reads no files."""

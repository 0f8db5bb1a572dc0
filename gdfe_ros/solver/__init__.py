# SPDX-License-Identifier: Apache-2.0
"""The geometry-driven solver: local step, constant global matrix, equilibrium. It imports no ROS and reads no files."""

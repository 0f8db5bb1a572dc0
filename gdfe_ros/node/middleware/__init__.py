# SPDX-License-Identifier: Apache-2.0
"""Nodes, processes, message types and publishers of rclpy, for all nodes of this package."""

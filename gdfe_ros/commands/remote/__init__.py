# SPDX-License-Identifier: Apache-2.0
"""The commands that talk to other nodes, and their node; no other module of ``commands`` imports rclpy."""

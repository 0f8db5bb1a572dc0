# SPDX-License-Identifier: Apache-2.0
"""The commands that talk to other nodes, and their node; the only modules of the commands that import rclpy."""

# SPDX-License-Identifier: Apache-2.0
"""A node for the commands that talk to other nodes; the only modules of the commands that import rclpy."""

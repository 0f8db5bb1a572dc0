# SPDX-License-Identifier: Apache-2.0
"""A page for a node in another process, which it reads and commands over topics. Needs rclpy."""

# SPDX-License-Identifier: Apache-2.0
"""A page for a node that runs somewhere else: heard and commanded over its topics. Needs rclpy."""

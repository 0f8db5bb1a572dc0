# SPDX-License-Identifier: Apache-2.0
"""Session of a page that shows and commands a node in another process, over topics. Needs rclpy."""

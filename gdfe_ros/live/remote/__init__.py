# SPDX-License-Identifier: Apache-2.0
"""Session for a node in another process, which a page shows and commands over topics. Needs rclpy."""

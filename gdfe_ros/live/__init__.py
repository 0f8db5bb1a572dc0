# SPDX-License-Identifier: Apache-2.0
"""A simulation in a browser page: drawn while it runs, and commanded with the mouse. Needs no ROS.

`LiveSession` makes steps in a separate thread, with the node's stepping thread and inbox. `Page` draws its finished
steps at a limited frame rate, and converts the viewers' actions to orders as in the node. The package `remote` has a
session for a node in another process; it needs rclpy.
"""

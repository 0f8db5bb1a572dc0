# SPDX-License-Identifier: Apache-2.0
"""A simulation in a page of the browser: seen while it runs, and commanded with the mouse. Needs no ROS.

`LiveSession` steps in a thread of its own, with the node's stepper, inbox and drive; `Page` shows its finished steps at
most so many times a second and turns what viewers do into the node's orders. In the place of the one, `remote` has a
session for a node that runs somewhere else; that needs rclpy.
"""

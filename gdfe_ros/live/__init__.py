# SPDX-License-Identifier: Apache-2.0
"""A simulation in a browser page: drawn while it runs, and commanded with the mouse. Needs no ROS.

`LiveSession` steps in a separate thread, with the node's stepper, inbox and drive. `Page` draws its finished steps at a
limited frame rate and converts the viewers' actions to the node's orders. `remote` has a session for a node in another
process instead; that needs rclpy.
"""

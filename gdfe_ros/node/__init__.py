# SPDX-License-Identifier: Apache-2.0
"""The ROS 2 node ``gdfe_sim``: lifecycle, topics and services around a ``Simulation``.

The only room of the package, with ``testing/`` and ``examples/``, that imports rclpy.
"""

# SPDX-License-Identifier: Apache-2.0
"""The ROS 2 node ``gdfe_sim``: lifecycle, topics and services around a ``Simulation``.

Besides ``testing/`` and ``examples/``, this is the only subpackage that imports rclpy.
"""

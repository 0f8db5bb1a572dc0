# SPDX-License-Identifier: Apache-2.0
"""The ROS 2 node ``gdfe_sim``: lifecycle, topics and services around a ``Simulation``.

Outside this package, rclpy is imported only by ``testing/``, ``examples/``, the packages ``remote/`` of ``live/``,
``twin/`` and ``commands/``, and ``recording/decoding.py``.
"""

# SPDX-License-Identifier: Apache-2.0
"""Prepare the server that forks nodes and environments (see ``forking``): import modules, load kernels."""

from importlib import import_module
from importlib.util import find_spec

from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation

for needed, module in (
    ("rclpy", "gdfe_ros.node.middleware.process"),
    ("rclpy", "gdfe_ros.node.sim_node"),
    ("gymnasium", "gdfe_ros.testing.environment"),
):
    if find_spec(needed) is not None:
        import_module(module)
Simulation(load_scene("tendon_finger")).warm_up()

# SPDX-License-Identifier: Apache-2.0
"""Prepare the server that forks nodes (see ``forking``): import modules, load kernels that every scene needs."""

from gdfe_ros.node import process as process
from gdfe_ros.node import sim_node as sim_node
from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation

Simulation(load_scene("bend5")).warm_up()

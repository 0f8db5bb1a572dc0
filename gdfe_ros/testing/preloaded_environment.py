# SPDX-License-Identifier: Apache-2.0
"""Prepare the server that forks environments (see ``forking``): import modules, load kernels that every scene needs."""

from gdfe_ros.scene import load_scene
from gdfe_ros.simulation import Simulation
from gdfe_ros.testing import environment as environment

Simulation(load_scene("tendon_finger")).warm_up()

# SPDX-License-Identifier: Apache-2.0
"""``python -m gdfe_ros.node`` runs ``sim_node``."""

import sys

from gdfe_ros.entry import sim_node

if __name__ == "__main__":
    sys.argv[0] = "sim_node"
    sys.exit(sim_node())

# SPDX-License-Identifier: Apache-2.0
"""Names and descriptions of every parameter, topic and service of the node.

The node's declarations and the tables of its documentation page are both generated from this package.
"""

NODE_NAME = "gdfe_sim"

# SPDX-License-Identifier: Apache-2.0
"""Every parameter, topic and service of the node: the only place where they are named and described.

The declarations of the node and the tables of its page are both made from here.
"""

NODE_NAME = "gdfe_sim"

# SPDX-License-Identifier: Apache-2.0
"""Every parameter, topic and service of the node: the one place where they are named and described.

The declarations of the node and the tables of its page both come from here.
"""

NODE_NAME = "gdfe_sim"

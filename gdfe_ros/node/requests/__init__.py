# SPDX-License-Identifier: Apache-2.0
"""Services and actions of the node, and the bodies that they spawn, delete and move."""

# SPDX-License-Identifier: Apache-2.0
"""The run of a simulation without ROS, for the node, for twins and for the page in the browser."""

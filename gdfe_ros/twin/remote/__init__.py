# SPDX-License-Identifier: Apache-2.0
"""Subscriptions of a twin to the ROS topics of the real robot."""

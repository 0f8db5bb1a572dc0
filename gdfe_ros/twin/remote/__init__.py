# SPDX-License-Identifier: Apache-2.0
"""The real robot as a twin hears it over ROS topics."""

# SPDX-License-Identifier: Apache-2.0
"""MCAP bags of runs, in rosbag2's layout.

``recorder.Recorder`` writes a bag in a separate thread while a simulation runs. ``reader.BagReader`` reads a finished
bag. ``recovery.recover`` repairs a bag that a crash, a kill or a full disk truncated. All interfaces use serialised
messages (CDR bytes) and type names; no ROS is imported.
"""

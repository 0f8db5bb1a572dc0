# SPDX-License-Identifier: Apache-2.0
"""Runs as MCAP bags in rosbag2's layout: written by a separate thread, read back, repaired.

``recorder.Recorder`` writes while a simulation runs, ``reader.BagReader`` reads a finished bag,
``recovery.recover`` repairs one that a crash, a kill or a full disk truncated. All interfaces use
serialised messages (CDR bytes) and type names; no ROS is imported.
"""

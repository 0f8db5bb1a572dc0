# SPDX-License-Identifier: Apache-2.0
"""Runs as MCAP bags in rosbag2's layout: written from a thread of its own, read back, repaired.

``recorder.Recorder`` writes while a simulation runs, ``reader.BagReader`` reads a finished bag,
``recovery.recover`` repairs one that a crash, a kill or a full disk cut off. Everything here takes and
gives serialised messages (CDR bytes) and type names; no ROS is imported.
"""

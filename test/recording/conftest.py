# SPDX-License-Identifier: Apache-2.0
"""Clouds for recordings, made without our own code, and a process that records them."""

from __future__ import annotations

import os
import subprocess
import sys
from array import array
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from rclpy.serialization import serialize_message
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Header

from gdfe_ros.recording.bag_info import TopicInfo

ROOT = Path(__file__).parents[2]
MESH = TopicInfo(name="/gdfe_sim/mesh", type="sensor_msgs/msg/PointCloud2")
COMMAND = TopicInfo(name="/gdfe_sim/handles/tip/target", type="geometry_msgs/msg/PoseStamped")


@pytest.fixture
def mesh_topic() -> TopicInfo:
    """Return a topic of point clouds."""
    return MESH


@pytest.fixture
def command_topic() -> TopicInfo:
    """Return a topic of poses."""
    return COMMAND


@pytest.fixture
def make_cloud() -> Callable[..., bytes]:
    """Give a function of (n, 6) float32 values and a stamp [ns] that returns a PointCloud2 in CDR."""

    def make(values: np.ndarray, stamp: int = 0) -> bytes:
        names = ("x", "y", "z", "ux", "uy", "uz")
        cloud = PointCloud2(height=1, width=len(values), point_step=24, row_step=24 * len(values), is_dense=True)
        cloud.header = Header(stamp=Time(sec=stamp // 10**9, nanosec=stamp % 10**9), frame_id="world")
        cloud.fields = [PointField(name=name, offset=4 * k, datatype=7, count=1) for k, name in enumerate(names)]
        cloud.data = array("B", values.astype("<f4").tobytes())
        return serialize_message(cloud)

    return make


@pytest.fixture
def start_process() -> Callable[..., subprocess.Popen[str]]:
    """Give a function that starts Python code in its own process, with this package importable."""

    def start(code: str, *arguments: object) -> subprocess.Popen[str]:
        path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
        return subprocess.Popen(
            [sys.executable, "-c", code, *map(str, arguments)],
            env={**os.environ, "PYTHONPATH": path},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    return start

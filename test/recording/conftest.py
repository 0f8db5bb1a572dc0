# SPDX-License-Identifier: Apache-2.0
"""Clouds for recordings, made without our own code, and a process that records them."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from gdfe_ros.recording.bag_info import TopicInfo

ROOT = Path(__file__).parents[2]
MESH = TopicInfo(name="/gdfe_sim/mesh", type="sensor_msgs/msg/PointCloud2")
COMMAND = TopicInfo(name="/gdfe_sim/handles/tip/target", type="geometry_msgs/msg/PoseStamped")


@cache
def _store() -> object:
    return get_typestore(Stores.ROS2_JAZZY)


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
        store = _store()
        kinds = store.types
        header = kinds["std_msgs/msg/Header"](
            stamp=kinds["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9),
            frame_id="world",
        )
        fields = [
            kinds["sensor_msgs/msg/PointField"](name=name, offset=4 * place, datatype=7, count=1)
            for place, name in enumerate(("x", "y", "z", "ux", "uy", "uz"))
        ]
        cloud = kinds[MESH.type](
            header=header,
            height=1,
            width=len(values),
            fields=fields,
            is_bigendian=False,
            point_step=24,
            row_step=24 * len(values),
            data=np.frombuffer(values.astype("<f4").tobytes(), np.uint8),
            is_dense=True,
        )
        return bytes(store.serialize_cdr(cloud, MESH.type))

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

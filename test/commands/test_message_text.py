# SPDX-License-Identifier: Apache-2.0
"""Messages as text on the command line."""

from __future__ import annotations

import numpy as np
import pytest
import yaml
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import PointCloud2

from gdfe_ros.commands.remote.message_text import MOST_SHOWN, show
from gdfe_ros.recording.message_tables import MESH, write_mesh
from gdfe_ros.recording.packing import Packer


def _make_cloud(count: int) -> PointCloud2:
    rest = np.arange(3.0 * count).reshape(count, 3)
    data = Packer(MESH, "map", count).pack(0, lambda rows: write_mesh(rows, rest + 0.1, rest))
    return deserialize_message(data, PointCloud2)


def test_a_cloud_is_shown_as_points() -> None:
    """Each point has its fields as numbers in seven digits; a long cloud has its number of points at the end."""
    shown = yaml.safe_load(show(_make_cloud(MOST_SHOWN + 3)))
    assert shown["header"]["frame_id"] == "map"
    assert list(shown["points"][1]) == ["x", "y", "z", "ux", "uy", "uz"]
    assert (shown["points"][1]["x"], shown["points"][1]["ux"]) == (3.1, 0.1)
    assert shown["points"][MOST_SHOWN:] == [f"... {MOST_SHOWN + 3} points"]


@pytest.mark.parametrize("defect", [{"width": 9}, {"point_step": 8}, {"row_step": 1}])
def test_a_defective_cloud_is_shown_as_it_is(defect: dict[str, int]) -> None:
    """A cloud whose sizes contradict each other keeps its fields and bytes."""
    cloud = _make_cloud(2)
    for name, value in defect.items():
        setattr(cloud, name, value)
    assert "data" in yaml.safe_load(show(cloud))

# SPDX-License-Identifier: Apache-2.0
"""The RViz and Foxglove configurations show topics and fields that the node publishes."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml
from rosbags.typesys import Stores, get_typestore

from gdfe_ros.node.interface import NODE_NAME, Delivery
from gdfe_ros.node.interface.topics import OUTPUTS
from gdfe_ros.recording.message_tables import MESH, STRAIN

CONFIG = Path(__file__).parents[2] / "config"
TYPES = {
    "Marker": "visualization_msgs/msg/Marker",
    "MarkerArray": "visualization_msgs/msg/MarkerArray",
    "PointCloud2": "sensor_msgs/msg/PointCloud2",
}
COLUMNS = {"mesh": MESH.names, "strain": STRAIN.names}


def _spec(topic: str) -> Any:
    """Return the node's output whose name pattern matches a topic."""
    for spec in OUTPUTS:
        name = spec.name.replace("~", f"/{NODE_NAME}")
        if re.fullmatch(re.sub(r"\{\w+\}", "[^/]+", name), topic):
            return spec
    raise AssertionError(f"the node publishes no {topic}")


def test_rviz_shows_topics_of_the_node() -> None:
    """Each RViz display has the topic, type, field and durability of the node's own table."""
    manager = yaml.safe_load((CONFIG / "rviz" / "sim.rviz").read_text(encoding="utf-8"))["Visualization Manager"]
    displays = [display for display in manager["Displays"] if "Topic" in display]
    assert len(displays) == 4
    for display in displays:
        topic = display["Topic"]
        spec = _spec(topic["Value"])
        assert spec.type == TYPES[display["Class"].rpartition("/")[2]]
        assert topic["Durability Policy"] == "Transient Local"
        assert spec.delivery in (Delivery.STATE, Delivery.CLOUD, Delivery.LATCHED)
        if "Channel Name" in display:
            assert display["Channel Name"] in COLUMNS[spec.name.removeprefix("~/")]


def test_foxglove_plots_topics_and_fields_of_the_node() -> None:
    """Each topic, field and message path in the Foxglove layout exists in the node's table and message types."""
    layout = json.loads((CONFIG / "foxglove" / "sim.json").read_text(encoding="utf-8"))
    panels, store = layout["configById"], get_typestore(Stores.ROS2_JAZZY)
    assert set(_leaves(layout["layout"])) == set(panels)
    clouds = panels["3D!body"]["topics"]
    for topic, shown in clouds.items():
        spec = _spec(topic)
        assert shown.get("colorField", "x") in COLUMNS.get(spec.name.removeprefix("~/"), ("x",))
    paths = [entry["value"] for panel in panels.values() for entry in panel.get("paths", ())]
    assert paths
    for path in paths:
        topic, *fields = path.split(".")
        kind = _spec(topic).type
        for field in fields:
            known = dict(store.fielddefs[kind][1])
            assert field.partition("[")[0] in known, path
            _, what = known[field.partition("[")[0]]
            kind = what if isinstance(what, str) else what[0]
    assert _spec(panels["DiagnosticSummary!node"]["topicToRender"])


def _leaves(node: Any) -> Iterator[str]:
    """Yield the panels of a layout."""
    if isinstance(node, str):
        yield node
    else:
        yield from _leaves(node["first"])
        yield from _leaves(node["second"])

# SPDX-License-Identifier: Apache-2.0
"""Lifecycle transitions by services, and their failures for a bad scene or parameter."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from gdfe_ros.node.messages import to_time
from gdfe_ros.scene import scene_names

DEFECTS = """
name: bad
mesh: {bar: {size: [0.2, -0.05, 0.05], cells: [20, 0, 5]}}
materials:
  a: {law: linear, young: -1, poisson: 0.7}
  b: {law: nonsense, young: 1}
regions: [{material: c}]
handles:
  base: {where: {face: w-}, fixed: true}
  tip: {where: {face: x+}, free: [q]}
program: {duration: -1}
solver: {policy: magic}
"""


def test_a_missing_scene_leaves_the_node_up_to_try_again(client: Any, start: Callable, coarse: dict) -> None:
    """A node with an unknown scene lists the known ones; with a right one, configure and activate succeed."""
    process = start(scene="nosuch")
    client.wait(lambda: "autostart failed" in process.log)
    assert f"does not exist; scenes: {', '.join(scene_names())}" in process.log
    assert client.state() == "unconfigured"
    assert "does not exist" in client.diagnostics()["message"]
    assert all(result.successful for result in client.set(**coarse))
    assert client.transition("configure")
    assert client.transition("activate")
    client.wait(lambda: client.received["mesh"])
    assert client.diagnostics()["state"] == "active"


def test_a_required_scene_that_is_missing_ends_the_process(start: Callable) -> None:
    """With `required`, a node with an unknown scene ends with status 1 after it has listed the known ones."""
    process = start(scene="nosuch", required=True)
    assert process.wait() == 1
    assert "does not exist; scenes: " in process.log
    assert "because the parameter `required` is true" in process.log


def test_all_defects_of_a_scene_are_named_at_once(client: Any, start: Callable, tmp_path: Path) -> None:
    """All ten defects of a scene are in the log, and the node keeps running."""
    path = tmp_path / "bad.yaml"
    path.write_text(DEFECTS, encoding="utf-8")
    process = start(scene=str(path))
    client.wait(lambda: "autostart failed" in process.log)
    assert "10 defects" in process.log
    for key in ("mesh.bar.size", "poisson = 0.7", "law = 'nonsense'", "face = 'w-'", "policy = 'magic'"):
        assert key in process.log
    assert client.state() == "unconfigured"


def test_parameters_are_changed_when_they_may(client: Any, start: Callable, coarse: dict) -> None:
    """An active node accepts a rate, also as an integer; other parameters are refused with what is allowed and when."""
    start(**coarse)
    client.wait(lambda: client.received["mesh"])
    fine, scene, clock, low, nan, autostart = client.set(
        rate=50, scene="tensile", clock="sundial", dt=-1.0, deadline=float("nan"), autostart=False
    )
    assert fine.successful
    assert scene.reason == "scene can be changed while unconfigured; the node is active"
    assert clock.reason == "parameter clock is 'sundial'; allowed: wall, fast, lockstep, external"
    assert "dt" in low.reason
    assert "deadline" in nan.reason
    assert "autostart" in autostart.reason
    assert not any(result.successful for result in (scene, clock, low, nan, autostart))


def test_the_state_outlives_deactivate_but_not_cleanup(client: Any, start: Callable, coarse: dict) -> None:
    """A lifted tip stays lifted after deactivate and activate, and is undeformed after cleanup and configure."""
    start(**coarse)
    client.target(0.1)
    client.wait(lambda: client.mesh()[:, 5].max() > 0.09)
    assert client.transition("deactivate")
    made = int(client.diagnostics()["steps"])
    assert client.transition("activate")
    client.wait(lambda: client.record().step >= made)
    lifted = to_time(client.record().stamp)
    assert np.frombuffer(client.arrived("mesh", lifted).data, "<f4").reshape(-1, 6)[:, 5].max() > 0.09
    assert all(client.transition(label) for label in ("deactivate", "cleanup", "configure"))
    client.received["mesh"].clear()
    assert client.transition("activate")
    client.wait(lambda: abs(client.mesh()[:, 3:]).max() < 1e-6)
    assert client.diagnostics()["state"] == "active"


def test_a_bag_in_the_way_is_said_and_can_be_put_right(
    client: Any, start: Callable, coarse: dict, tmp_path: Path
) -> None:
    """A bag path that is not empty makes activate fail with the reason; another path succeeds."""
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "file").touch()
    process = start(**coarse, record=True, bag_path=str(tmp_path / "bag"))
    client.wait(lambda: "could not be activated" in process.log)
    assert "exists and is not empty" in process.log
    client.wait(lambda: client.state() == "inactive")
    assert client.set(bag_path=str(tmp_path / "other"))[0].successful
    assert client.transition("activate")
    assert process.stop() == 0
    assert (tmp_path / "other" / "metadata.yaml").is_file()

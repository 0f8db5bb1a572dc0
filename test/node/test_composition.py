# SPDX-License-Identifier: Apache-2.0
"""Several robots: nodes in namespaces, in one process under one executor."""

from __future__ import annotations

import gc
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import rclpy
from rclpy.executors import MultiThreadedExecutor
from rclpy.parameter import Parameter

from gdfe_ros.node.middleware.process import make_executor
from gdfe_ros.node.requests import things
from gdfe_ros.node.requests.entities import MOST_WAITING
from gdfe_ros.node.sim_node import SimNode
from gdfe_ros.scene.entity import read_entity

COARSE = ["mesh.bar.cells=[8, 2, 2]"]


@pytest.mark.parametrize(
    "make",
    [make_executor, lambda context: MultiThreadedExecutor(num_threads=3, context=context)],
    ids=["events", "threads"],
)
def test_two_robots_run_in_one_process(make: Callable[[Any], Any]) -> None:
    """Two nodes of different kinds in one executor become active and step by themselves."""
    context = rclpy.Context()
    rclpy.init(context=context)
    executor = make(context)
    nodes = [
        SimNode(
            namespace=f"robot_{number}",
            context=context,
            parameter_overrides=[Parameter("scene", value=scene), Parameter("scene_overrides", value=COARSE)],
        )
        for number, scene in enumerate(("bend5", "twist90"))
    ]
    for node in nodes:
        executor.add_node(node)
    end, meshes = time.monotonic() + 300.0, {"/robot_0/gdfe_sim/mesh", "/robot_1/gdfe_sim/mesh"}
    try:
        while any(node.lifecycle_state != "active" for node in nodes) or not meshes <= {
            name for name, _ in nodes[0].get_topic_names_and_types()
        }:
            assert time.monotonic() < end
            executor.spin_once(timeout_sec=0.1)
    finally:
        for node in nodes:
            node.close()
            executor.remove_node(node)
            node.destroy_node()
        executor.shutdown()
        rclpy.shutdown(context=context)


@pytest.mark.parametrize("active", [False, True])
def test_a_destroyed_node_leaves_the_graph(ros: Any, slab: Path, active: bool) -> None:
    """A node that is destroyed, also while it steps, ends its threads and leaves the graph before it is collected."""
    context = rclpy.Context()
    rclpy.init(context=context)
    executor, parameters = make_executor(context), {"scene": str(slab), "clock": "wall", "autostart": active}
    overrides = [Parameter(name, value=value) for name, value in parameters.items()]
    node = SimNode(namespace="leaving", context=context, parameter_overrides=overrides)
    executor.add_node(node)
    watcher = ros.node("watcher")

    def is_seen() -> bool:
        executor.spin_once(timeout_sec=0.1)
        return ("gdfe_sim", "/leaving") in watcher.get_node_names_and_namespaces()

    ros.wait(lambda: is_seen() and node.lifecycle_state == ("active" if active else "unconfigured"))
    gc.disable()
    try:
        executor.remove_node(node)
        if not active:
            node.close()
        node.destroy_node()
        ros.wait(lambda: not is_seen())
    finally:
        gc.enable()
    executor.shutdown()
    rclpy.shutdown(context=context)
    assert node.session is None
    assert active or node.lifecycle_state == "finalized"


def test_a_spawned_body_is_read_in_a_thread_of_its_own(
    ros: Any, interfaces: Callable, slab: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While the description of a body is read, the node answers; too many requests are refused meanwhile."""
    interfaces("simulation_interfaces")
    from simulation_interfaces.srv import SpawnEntity

    go_on = threading.Event()

    def read(text: str, **options: str) -> object:
        assert go_on.wait(60.0)
        return read_entity(text, **options)

    monkeypatch.setattr(things, "read_entity", read)
    parameters = [Parameter("scene", value=str(slab)), Parameter("clock", value="lockstep")]
    node = ros.node(SimNode, parameter_overrides=parameters)
    service = ros.node("client").create_client(SpawnEntity, "/gdfe_sim/spawn_entity")

    ros.wait(lambda: node.lifecycle_state == "active" and service.service_is_ready())
    request = SpawnEntity.Request(name="part", allow_renaming=False)
    request.entity_resource.resource_string = "{box: {size: [1, 1, 1]}, mass: 1}"
    request.initial_pose.pose.position.x = 0.3
    answers = []
    for number in range(MOST_WAITING + 1):  # the first one is being read
        answers.append(service.call_async(request))
        ros.wait(lambda waiting=number: len(node._entities._exchange._waiting) == waiting)
    answers.append(service.call_async(request))
    ros.wait(answers[-1].done)
    go_on.set()
    ros.wait(lambda: all(answer.done() for answer in answers))
    texts = [answer.result().result.error_message for answer in answers]
    node.close()
    assert sum("is taken" in text for text in texts) == MOST_WAITING + 1
    assert all("is taken" in text or "ask again later" in text for text in texts), texts

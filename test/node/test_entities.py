# SPDX-License-Identifier: Apache-2.0
"""Rigid bodies as entities of simulation_interfaces: spawned, deleted, listed, asked and put elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from std_srvs.srv import SetBool, Trigger

from gdfe_ros.analysis.bag_run import BagRun
from gdfe_ros.analysis.difference import Difference
from gdfe_ros.analysis.replay import Replay

CUBE = """<robot name="cube"><link name="cube">
<inertial><mass value="0.02"/><inertia ixx="3e-6" ixy="0" ixz="0" iyy="3e-6" iyz="0" izz="3e-6"/></inertial>
<collision><origin xyz="0 0 0.015"/><geometry><box size="0.03 0.03 0.03"/></geometry></collision>
</link><gazebo reference="cube"><mu1>0.5</mu1></gazebo></robot>"""
UNSUPPORTED, OK, NOT_FOUND, FAILED = 0, 1, 2, 4
NOT_UNIQUE, NAME_INVALID, FORMAT, NO_RESOURCE, NAMESPACE, PARSE, POSE = 101, 102, 103, 104, 105, 106, 109


class _Entities:
    """A client of a node's services for entities."""

    def __init__(self, client: Any) -> None:
        from simulation_interfaces import srv

        self._client, self._srv = client, srv

    def spawn(self, name: str = "", at: Any = (0.0, 0.0, 0.0), text: str = CUBE, **changes: Any) -> Any:
        request = self._srv.SpawnEntity.Request(name=name)
        request.entity_resource.resource_string = text
        self._place(request.initial_pose.pose, at)
        for key, value in changes.items():
            holder = request
            *path, last = key.split("__")
            for part in path:
                holder = getattr(holder, part)
            setattr(holder, last, value)
        return self._client.call(self._srv.SpawnEntity, "spawn_entity", request)

    def delete(self, name: str) -> Any:
        request = self._srv.DeleteEntity.Request(entity=name)
        return self._client.call(self._srv.DeleteEntity, "delete_entity", request).result

    def names(self, pattern: str = "") -> list[str]:
        request = self._srv.GetEntities.Request()
        request.filters.filter = pattern
        return list(self._client.call(self._srv.GetEntities, "get_entities", request).entities)

    def state(self, name: str) -> Any:
        request = self._srv.GetEntityState.Request(entity=name)
        response = self._client.call(self._srv.GetEntityState, "get_entity_state", request)
        assert response.result.result == OK, response.result.error_message
        return response.state

    def put(self, name: str, at: Any) -> Any:
        request = self._srv.SetEntityState.Request(entity=name, set_pose=True)
        self._place(request.state.pose, at)
        return self._client.call(self._srv.SetEntityState, "set_entity_state", request).result

    def reset(self, scope: int) -> Any:
        request = self._srv.ResetSimulation.Request(scope=scope)
        return self._client.call(self._srv.ResetSimulation, "reset_simulation", request).result

    @staticmethod
    def _place(pose: Any, at: Any) -> None:
        pose.position.x, pose.position.y, pose.position.z = map(float, at)


@pytest.fixture
def entities(client: Any, interfaces: Callable) -> _Entities:
    """Give a client of the services."""
    interfaces("simulation_interfaces")
    return _Entities(client)


def _steps(client: Any, count: int) -> None:
    for _ in range(count):
        response = client.call(Trigger, "step", Trigger.Request())
        assert response.success, response.message


def _height(entities: _Entities, name: str) -> float:
    return entities.state(name).pose.position.z


def test_a_spawned_box_falls_onto_the_body_and_is_recorded(
    client: Any, start: Callable, slab: Path, entities: _Entities, tmp_path: Path
) -> None:
    """A box from URDF joins a running simulation, falls onto the slab, and is part of a bag, which replays."""
    start(scene=str(slab), clock="lockstep", dt=0.005)
    client.wait(client.records)
    _steps(client, 3)
    spawned = entities.spawn(at=(0.15, 0.0, 0.1))
    assert (spawned.result.result, spawned.entity_name) == (OK, "cube"), spawned.result.error_message
    assert entities.names() == ["part", "cube"]
    assert entities.names("^cu") == ["cube"]
    assert _height(entities, "cube") == pytest.approx(0.1, abs=1e-12)
    client.set(bag_path=str(tmp_path / "bag"))
    assert client.call(SetBool, "record", SetBool.Request(data=True)).success
    _steps(client, 4)
    state = entities.state("cube")
    assert state.twist.linear.z == pytest.approx(-9.81 * 0.02, rel=0.2)
    assert state.pose.position.z == pytest.approx(0.1 - 0.5 * 9.81 * 0.02**2, abs=5e-4)
    assert "bag is being written" in entities.spawn("second", at=(0.3, 0.0, 0.1)).result.error_message
    assert client.call(SetBool, "record", SetBool.Request(data=False)).success
    assert Replay(BagRun(tmp_path / "bag")).run().differences.verdict() is Difference.IDENTICAL


def test_bodies_that_stay_are_not_disturbed(client: Any, start: Callable, slab: Path, entities: _Entities) -> None:
    """Mesh and part move through a spawn and a deletion as they would without them; time goes on."""
    start(scene=str(slab), clock="lockstep", dt=0.005)
    client.wait(client.records)
    _steps(client, 4)
    assert entities.spawn(at=(0.3, 0.0, 0.2)).result.result == OK
    _steps(client, 4)
    assert entities.delete("cube").result == OK
    _steps(client, 4)
    assert client.record().time == pytest.approx(0.06)
    found = client.mesh()
    assert client.call(Trigger, "reset", Trigger.Request()).success
    _steps(client, 12)
    client.wait(lambda: client.record().time == pytest.approx(0.06))
    assert np.abs(client.mesh() - found).max() < 1e-5


def test_spawned_bodies_go_with_a_reset(client: Any, start: Callable, slab: Path, entities: _Entities) -> None:
    """The scope of spawned bodies removes them and time goes on; a whole reset removes them and starts anew."""
    start(scene=str(slab), clock="lockstep", dt=0.005)
    client.wait(client.records)
    _steps(client, 2)
    names = [entities.spawn("box", at=(0.3 + 0.1 * i, 0, 0.2), allow_renaming=True).entity_name for i in range(2)]
    assert names == ["box", "box_2"]
    assert entities.reset(4).result == OK
    assert entities.names() == ["part"]
    assert float(client.status()["simulation time [s]"]) == pytest.approx(0.01)
    assert entities.spawn("box", at=(0.3, 0, 0.2)).result.result == OK
    assert entities.reset(0).result == OK
    assert entities.names() == ["part"]
    assert client.status()["simulation time [s]"] == "0"
    _steps(client, 1)


def test_a_body_is_put_elsewhere(client: Any, start: Callable, slab: Path, entities: _Entities) -> None:
    """The frame of a spawned body is the link's, also where it is put; bodies of the scene can be put, too."""
    start(scene=str(slab), clock="lockstep", dt=0.005)
    client.wait(client.records)
    assert entities.spawn(at=(0.3, 0, 0.2)).result.result == OK
    for name in ("cube", "part"):
        assert entities.put(name, (0.4, 0.1, 0.5)).result == OK
        _steps(client, 1)
        pose = entities.state(name).pose.position
        assert (pose.x, pose.y) == pytest.approx((0.4, 0.1), abs=1e-6)
        assert pose.z == pytest.approx(0.5, abs=1e-3)
        assert entities.put(name, (0.5, 0.1, 0.5)).result == OK
        _steps(client, 1)
    assert entities.delete("part").result == FAILED
    assert entities.delete("nobody").result == NOT_FOUND


def test_a_body_joins_while_the_clock_runs(client: Any, start: Callable, slab: Path, entities: _Entities) -> None:
    """With the wall clock the node goes on playing, or stays paused, after a body was spawned."""
    start(scene=str(slab), clock="wall", rate=50.0, dt=0.005)
    client.wait(client.records)
    assert entities.spawn(at=(0.3, 0, 0.2)).result.result == OK
    client.wait(lambda: _height(entities, "cube") < 0.1)
    assert client.call(SetBool, "pause", SetBool.Request(data=True)).success
    assert entities.spawn("late", at=(0.5, 0, 0.2)).result.result == OK
    client.spin(0.3)
    assert _height(entities, "late") == pytest.approx(0.2)
    assert client.call(SetBool, "pause", SetBool.Request(data=False)).success
    client.wait(lambda: _height(entities, "late") < 0.19)


@pytest.mark.parametrize(
    ("changes", "code", "text"),
    [
        ({"text": ""}, NO_RESOURCE, "uri and resource_string are empty"),
        ({"text": "<robot"}, PARSE, "this is not XML"),
        ({"text": CUBE.replace('value="0.02"', 'value="0"')}, PARSE, "has no mass; remedy"),
        ({"name": "b", "text": "{box: {size: [1, 1]}, mass: 1}"}, FAILED, "box.size"),
        ({"text": "{box: {size: [1, 1, 1]}, mass: 1}"}, NAME_INVALID, "letters, digits"),
        ({"text": "{sphere: {radius: 0.01}, mass: 1, at: [0, 0, 0]}"}, PARSE, "initial_pose states the place"),
        ({"entity_resource__uri": "http://x/cube.sdf"}, FORMAT, "allowed: file:///path or a path"),
        ({"entity_resource__uri": "/nowhere/cube.urdf"}, PARSE, "cannot be read"),
        ({"name": "a b"}, NAME_INVALID, "letters, digits"),
        ({"name": "part"}, NOT_UNIQUE, "is taken"),
        ({"entity_namespace": "left"}, NAMESPACE, "allowed: empty"),
        ({"at": (float("nan"), 0, 0)}, POSE, "finite"),
        ({"initial_pose__header__frame_id": "moon"}, POSE, "'moon'"),
        ({"at": (0.05, 0.05, 0.0)}, FAILED, "inside of"),
    ],
)
def test_a_body_that_cannot_join_is_refused(
    client: Any, start: Callable, slab: Path, entities: _Entities, changes: dict, code: int, text: str
) -> None:
    """A defect is named with its code and text, and the simulation goes on as before."""
    start(scene=str(slab), clock="lockstep", dt=0.005)
    client.wait(client.records)
    answer = entities.spawn(**{"at": (0.3, 0, 0.2), **changes}).result
    assert (answer.result, text in answer.error_message) == (code, True), answer.error_message
    assert entities.names() == ["part"]
    _steps(client, 2)
    assert client.record().converged


def test_a_scene_without_dynamics_takes_no_bodies(
    client: Any, start: Callable, coarse: dict, entities: _Entities
) -> None:
    """In statics a body cannot move; the answer says so."""
    start(**coarse, clock="lockstep")
    client.wait(client.records)
    answer = entities.spawn().result
    assert (answer.result, "no `dynamics`" in answer.error_message) == (FAILED, True)

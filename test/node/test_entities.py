# SPDX-License-Identifier: Apache-2.0
"""Rigid bodies as entities of simulation_interfaces: spawned, deleted, listed, asked and put elsewhere."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from std_srvs.srv import SetBool, Trigger

from gdfe_ros.analysis.bag_run import BagRun
from gdfe_ros.analysis.difference import Difference
from gdfe_ros.analysis.replay import Replay
from gdfe_ros.scene import scene_from_text

CUBE = """<robot name="cube"><link name="cube">
<inertial><mass value="0.02"/><inertia ixx="3e-6" ixy="0" ixz="0" iyy="3e-6" iyz="0" izz="3e-6"/></inertial>
<collision><origin xyz="0 0 0.015"/><geometry><box size="0.03 0.03 0.03"/></geometry></collision>
</link><gazebo reference="cube"><mu1>0.5</mu1></gazebo></robot>"""
BOMB = "a: &a [1, 1, 1, 1, 1, 1, 1, 1, 1]\n" + "\n".join(
    f"{after}: &{after} [{', '.join([f'*{name}'] * 9)}]" for name, after in zip("abcdefgh", "bcdefghi", strict=True)
)
"""YAML of ten lines that stands for 9^9 values."""
PATIENCE = 60.0
"""Longest time of an answer on a busy machine [s]; without limits, it would be hours."""
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

    def spawn_together(self, names: list[str]) -> list[Any]:
        """Ask for cubes without waiting for the answers; return the futures."""
        service = self._client.node.create_client(self._srv.SpawnEntity, self._client.full("spawn_entity"))
        self._client.wait(service.service_is_ready)
        answers = []
        for place, name in enumerate(names):
            request = self._srv.SpawnEntity.Request(name=name)
            request.entity_resource.resource_string = CUBE
            self._place(request.initial_pose.pose, (0.3 + 0.1 * place, 0.0, 0.2))
            answers.append(service.call_async(request))
        return answers

    def names(self, pattern: str = "") -> list[str]:
        return list(self._matching(pattern).entities)

    def asked(self, pattern: str) -> Any:
        return self._matching(pattern).result

    def _matching(self, pattern: str) -> Any:
        request = self._srv.GetEntities.Request()
        request.filters.filter = pattern
        return self._client.call(self._srv.GetEntities, "get_entities", request)

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
    for name, y in (("cube", 0.1), ("part", 0.3)):
        assert entities.put(name, (0.4, y, 0.5)).result == OK
        _steps(client, 1)
        pose = entities.state(name).pose.position
        assert (pose.x, pose.y) == pytest.approx((0.4, y), abs=1e-6)
        assert pose.z == pytest.approx(0.5, abs=1e-3)
    assert "inside of" in entities.put("part", (0.4, 0.1, 0.5)).error_message
    assert entities.put("part", (1e300, 0.1, 0.5)).result == POSE
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


REFUSED: tuple[tuple[dict[str, Any], int, str], ...] = (
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
    ({"name": "weight"}, NOT_UNIQUE, "is taken"),
    ({"name": 300 * "a"}, NAME_INVALID, "up to 60 letters"),
    ({"text": CUBE.replace("0.5</mu1>", "-1</mu1>")}, PARSE, "<mu1> is '-1'"),
    ({"text": CUBE.replace("0.03 0.03 0.03", "1e200 1 1")}, PARSE, "box.size"),
    ({"entity_resource__uri": "file:///a%00b.urdf"}, PARSE, "cannot be read"),
    ({"entity_namespace": "left"}, NAMESPACE, "allowed: empty"),
    ({"at": (float("nan"), 0, 0)}, POSE, "finite"),
    ({"initial_pose__header__frame_id": "moon"}, POSE, "'moon'"),
    ({"at": (0.05, 0.05, 0.0)}, FAILED, "inside of"),
    ({"at": (1e6, 0.0, 0.0)}, POSE, "times the body's size"),
    ({"text": BOMB}, PARSE, "aliases repeat"),
    ({"text": f"{{box: {{size: [{'1' * 60_000}, 1, 1]}}, mass: 1}}"}, PARSE, "has 60000 characters"),
    ({"text": CUBE.replace("<robot", "<!DOCTYPE a><robot", 1)}, PARSE, "document type"),
    ({"text": "# " + "x" * 200_000}, PARSE, "allowed: up to 100000"),
    ({"name": "cube\n"}, NAME_INVALID, "letters, digits"),
    ({"entity_resource__uri": "/dev/zero.yaml"}, PARSE, "cannot be read"),
    ({"name": "b", "text": "{mesh: {file: /dev/zero}, mass: 1}"}, FAILED, "no regular file"),
)
"""What a request to spawn changes, the code of the answer, and a part of its text."""


def test_a_body_that_cannot_join_is_refused_soon(client: Any, start: Callable, slab: Path, entities: _Entities) -> None:
    """A defect, or a resource that would take hours to read, is named with its code; the simulation goes on."""
    start(scene=str(slab), clock="lockstep", dt=0.005)
    client.wait(client.records)
    for changes, code, text in REFUSED:
        began = time.monotonic()
        answer = entities.spawn(**{"at": (0.3, 0, 0.2), **changes}).result
        client.state()
        assert time.monotonic() - began < PATIENCE
        assert (answer.result, text in answer.error_message) == (code, True), (changes, answer.error_message)
        assert entities.names() == ["part"]
        _steps(client, 2)
        assert client.record().converged


def test_what_waits_for_the_next_step_survives_a_spawn(
    client: Any, start: Callable, slab: Path, entities: _Entities
) -> None:
    """A teleport and a queued command that were accepted before a spawn take effect after it; steps count on."""
    start(scene=str(slab), clock="lockstep", dt=0.005)
    client.wait(client.records)
    _steps(client, 2)
    assert entities.put("part", (0.4, 0.3, 0.5)).result == OK
    assert entities.spawn(at=(0.3, 0, 0.2)).result.result == OK
    _steps(client, 1)
    assert entities.state("part").pose.position.x == pytest.approx(0.4, abs=1e-6)
    assert int(client.status()["steps"]) >= 4


def test_a_finished_bag_does_not_begin_again(
    client: Any, start: Callable, slab: Path, entities: _Entities, tmp_path: Path
) -> None:
    """With `record` true, a spawn after the bag was finished begins no bag, whether it succeeds or not."""
    start(scene=str(slab), clock="lockstep", dt=0.005, record=True, bag_path=str(tmp_path / "bag"))
    client.wait(client.records)
    assert client.call(SetBool, "record", SetBool.Request(data=False)).success
    assert entities.spawn("low", at=(0.05, 0.05, 0.0)).result.result == FAILED
    assert entities.spawn("high", at=(0.3, 0.0, 0.2)).result.result == OK
    _steps(client, 2)
    assert "not recording" in client.call(SetBool, "record", SetBool.Request(data=False)).message
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith("bag")] == ["bag"]


def test_a_modulus_set_during_a_spawn_stays(client: Any, start: Callable, slab: Path, entities: _Entities) -> None:
    """A Young's modulus that is set while the new scene is prepared holds afterwards."""
    start(scene=str(slab), clock="lockstep", dt=0.005)
    client.wait(client.records)
    assert client.set(**{"materials.soft.young": 2.1e5})[0].successful  # the service is known from now on
    names = [f"box{i}" for i in range(3)]
    waiting = entities.spawn_together(names)
    assert client.set(**{"materials.soft.young": 2.5e5})[0].successful
    assert not all(answer.done() for answer in waiting)
    client.wait(lambda: all(answer.done() for answer in waiting), seconds=60.0)
    assert [answer.result().result.result for answer in waiting] == [OK, OK, OK]
    assert set(entities.names()) == {"part", *names}
    last = client.wait(lambda: all(name in client.last("scene").data for name in names) and client.last("scene"))
    assert scene_from_text(last.data).materials["soft"].young == 2.5e5


def test_strange_requests_are_answered(client: Any, start: Callable, slab: Path, entities: _Entities) -> None:
    """Unknown scopes of a reset, and expressions that could be matched forever, are refused."""
    start(scene=str(slab), clock="lockstep", dt=0.005)
    client.wait(client.records)
    assert "unknown bits" in entities.reset(8).error_message
    assert entities.asked(r"^(\w+_?)+!$").result == UNSUPPORTED
    assert entities.asked("(").result == FAILED
    assert entities.asked(".*" * 10 + "!$").result == UNSUPPORTED
    assert entities.asked("a" * 1000).result == UNSUPPORTED


def test_a_scene_without_dynamics_takes_no_bodies(
    client: Any, start: Callable, coarse: dict, entities: _Entities
) -> None:
    """In statics a body cannot move; the answer says so."""
    start(**coarse, clock="lockstep")
    client.wait(client.records)
    answer = entities.spawn().result
    assert (answer.result, "no `dynamics`" in answer.error_message) == (FAILED, True)

# SPDX-License-Identifier: Apache-2.0
"""Soft bodies as entities of simulation_interfaces, and the services that answer what there is."""

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
from gdfe_ros.testing import NodeProcess

CUBE = """{bar: {size: [0.03, 0.03, 0.03], cells: [2, 2, 2]},
  material: {law: neo_hookean, young: 1.0e5, poisson: 0.45, density: 1070}}"""
BOX = "{box: {size: [0.03, 0.03, 0.03]}, mass: 0.02}"
OK, FAILED, PARSE, NOT_UNIQUE, SOME_FAILED, UNSUPPORTED = 1, 4, 106, 101, 150, 0
PLACE = (0.3, 0.0, 0.2)


class _Bodies:
    """A client of the services for entities."""

    def __init__(self, client: Any, process: NodeProcess) -> None:
        from simulation_interfaces import msg, srv

        self._client, self._srv, self._msg, self.process = client, srv, msg, process

    def ask(self, kind: str, service: str, **fields: Any) -> Any:
        request = getattr(self._srv, kind).Request(**fields)
        return self._client.call(getattr(self._srv, kind), service, request)

    def spawn(self, name: str, text: str = CUBE, at: Any = PLACE) -> Any:
        wanted = self.wanted(name, text, at)
        fields = {key: getattr(wanted, key) for key in wanted.get_fields_and_field_types()}
        return self.ask("SpawnEntity", "spawn_entity", **fields)

    def wanted(self, name: str, text: str, at: Any) -> Any:
        found = self._msg.SpawnEntity(name=name)
        found.entity_resource.resource_string = text
        place = found.initial_pose.pose.position
        place.x, place.y, place.z = map(float, at)
        return found

    def filters(self, **fields: Any) -> Any:
        return self._msg.EntityFilters(**fields)

    def bounds(self, kind: int, *points: Any) -> Any:
        from geometry_msgs.msg import Vector3

        corners = [Vector3(**dict(zip("xyz", map(float, point), strict=True))) for point in points]
        return self._msg.Bounds(type=kind, points=corners)

    def names(self, **fields: Any) -> list[str]:
        return list(self.ask("GetEntities", "get_entities", filters=self.filters(**fields)).entities)


@pytest.fixture
def bodies(client: Any, interfaces: Callable, start: Callable, slab: Path) -> _Bodies:
    """Give a client of the services of a node with a slab and a rigid part, in lockstep."""
    interfaces("simulation_interfaces")
    process = start(scene=str(slab), clock="lockstep", dt=0.005)
    client.wait(client.records)
    return _Bodies(client, process)


def _steps(client: Any, count: int) -> None:
    for _ in range(count):
        response = client.call(Trigger, "step", Trigger.Request())
        assert response.success, response.message


def test_a_soft_body_joins_falls_is_asked_and_leaves(client: Any, bodies: _Bodies) -> None:
    """A soft cube joins a moving scene, falls by g t^2 / 2, has tags, bounds and a modulus, and leaves again."""
    _steps(client, 3)
    before = client.mesh()
    spawned = bodies.spawn("gel")
    assert (spawned.result.result, spawned.entity_name) == (OK, "gel"), spawned.result.error_message
    assert "self_contact" in spawned.result.error_message
    client.wait(lambda: len(client.mesh()) == len(before) + 27)
    assert np.abs(client.mesh()[: len(before)] - before).max() == 0.0
    assert bodies.names() == ["part", "gel"]
    _steps(client, 4)
    state = bodies.ask("GetEntityState", "get_entity_state", entity="gel").state
    assert state.twist.linear.z == pytest.approx(-9.81 * 0.02, rel=1e-2)
    assert state.pose.position.z == pytest.approx(PLACE[2] - 0.5 * 9.81 * 0.02**2, abs=5e-4)
    info = bodies.ask("GetEntityInfo", "get_entity_info", entity="gel").info
    assert (list(info.tags), info.description) == (["soft", "spawned"], "a soft body of 8 cells")
    box = bodies.ask("GetEntityBounds", "get_entity_bounds", entity="gel").bounds
    corners = np.array([[each.x, each.y, each.z] for each in box.points])
    assert box.type == 1
    assert corners == pytest.approx(np.array([[0.03, 0.015, 0.015], [0.0, -0.015, -0.015]]), abs=1e-5)
    assert client.set(**{"materials.gel.young": 5.0e4})[0].successful
    _steps(client, 2)
    assert client.record().converged
    assert bodies.ask("DeleteEntity", "delete_entity", entity="gel").result.result == OK
    client.wait(lambda: len(client.mesh()) == len(before))
    assert bodies.names() == ["part"]
    _steps(client, 2)
    assert client.record().converged


def test_a_soft_body_is_put_elsewhere_and_the_bag_repeats_it(client: Any, bodies: _Bodies, tmp_path: Path) -> None:
    """Its mean pose becomes the wanted one, its shape stays, and it falls from there; the bag replays to the bit."""
    assert bodies.spawn("gel").result.result == OK
    _steps(client, 2)
    client.set(bag_path=str(tmp_path / "bag"))
    assert client.call(SetBool, "record", SetBool.Request(data=True)).success
    _steps(client, 2)
    before = client.mesh()[-27:, :3]
    state = bodies.ask("GetEntityState", "get_entity_state", entity="gel").state
    state.twist.linear.x = state.twist.linear.y = state.twist.linear.z = 0.0
    state.pose.position.x, state.pose.position.z = 0.5, 0.4
    state.pose.orientation.w = state.pose.orientation.z = 0.5**0.5
    answer = bodies.ask("SetEntityState", "set_entity_state", entity="gel", state=state, set_pose=True)
    assert answer.result.result == OK, answer.result.error_message
    _steps(client, 1)
    found = bodies.ask("GetEntityState", "get_entity_state", entity="gel").state
    assert (found.pose.position.x, found.pose.position.z) == pytest.approx((0.5, 0.4), abs=5e-4)
    assert found.pose.orientation.z == pytest.approx(0.5**0.5, abs=1e-4)
    assert found.twist.linear.z == pytest.approx(-9.81 * 0.005, rel=0.05)
    after = client.mesh()[-27:, :3]
    sides = [np.linalg.norm(each[:, None] - each[None], axis=2) for each in (before, after)]
    assert sides[1] == pytest.approx(sides[0], abs=2e-6)
    _steps(client, 2)
    assert client.record().converged
    state.pose.position.x, state.pose.position.z = 0.05, 0.0
    inside = bodies.ask("SetEntityState", "set_entity_state", entity="gel", state=state, set_pose=True)
    assert "inside of" in inside.result.error_message
    state.twist.linear.z = 1.0
    moving = bodies.ask("SetEntityState", "set_entity_state", entity="gel", state=state, set_twist=True)
    assert (moving.result.result, "a velocity cannot be set" in moving.result.error_message) == (UNSUPPORTED, True)
    assert client.call(SetBool, "record", SetBool.Request(data=False)).success
    assert Replay(BagRun(tmp_path / "bag")).run().differences.verdict() is Difference.IDENTICAL


def test_several_bodies_join_in_one_request(client: Any, bodies: _Bodies) -> None:
    """Each entry has a result; a bad one does not hinder the others; states come with names, by filters."""
    wanted = [
        bodies.wanted("a", CUBE, PLACE),
        bodies.wanted("a", CUBE, (0.4, 0, 0.2)),
        bodies.wanted("b", "{bar: 3, material: {}}", PLACE),
        bodies.wanted("c", BOX, (0.5, 0, 0.2)),
    ]
    answer = bodies.ask("SpawnEntities", "spawn_entities", spawn_requests=wanted)
    assert answer.result.result == SOME_FAILED
    assert "2 of 4 joined; results[1]" in answer.result.error_message
    assert [each.result.result for each in answer.results] == [OK, NOT_UNIQUE, FAILED, OK]
    assert bodies.names() == ["part", "c", "a"]
    tags = bodies.filters().tags
    tags.tags = ["soft"]
    assert bodies.names(tags=tags) == ["a"]
    near = bodies.bounds(3, (0.5, 0, 0.2), (0.05, 0, 0))
    states = bodies.ask("GetEntitiesStates", "get_entities_states", filters=bodies.filters(bounds=near))
    assert list(states.entities) == ["c"]
    assert states.states[0].pose.position.x == pytest.approx(0.5)
    hull = bodies.ask("GetEntities", "get_entities", filters=bodies.filters(bounds=bodies.bounds(2, PLACE)))
    assert hull.result.result == UNSUPPORTED
    too_many = [bodies.wanted("x", BOX, PLACE)] * 101
    assert (
        "allowed: up to 100"
        in bodies.ask("SpawnEntities", "spawn_entities", spawn_requests=too_many).result.error_message
    )
    assert bodies.ask("ResetSimulation", "reset_simulation", scope=4).result.result == OK
    assert bodies.names() == ["part"]


def test_what_can_be_spawned_is_listed_and_can_be_spawned(client: Any, bodies: _Bodies, tmp_path: Path) -> None:
    """Each listed URI joins; folders in `sources` are listed without their subfolders; named poses have kinds."""
    (tmp_path / "more.yaml").write_text(BOX)
    (tmp_path / "more.txt").write_text(BOX)
    found = bodies.ask("GetSpawnables", "get_spawnables", sources=[str(tmp_path), "/nowhere"])
    uris = [each.uri for each in found.spawnables]
    assert [Path(uri).stem for uri in uris] == ["box", "soft_ball", "soft_cube", "more", "slab"]
    assert "/nowhere" in found.result.error_message
    for number, uri in enumerate(uris[:3]):
        from simulation_interfaces.srv import SpawnEntity

        request = SpawnEntity.Request(name=f"body{number}")
        request.entity_resource.uri = uri
        place = request.initial_pose.pose.position
        place.x, place.z = 0.3 + 0.1 * number, 0.2
        answer = client.call(SpawnEntity, "spawn_entity", request)
        assert answer.result.result == OK, answer.result.error_message
    _steps(client, 1)
    assert client.record().converged
    poses = bodies.ask("GetNamedPoses", "get_named_poses").poses
    assert {each.tags[0] for each in poses} <= {"handle", "obstacle", "probe"}
    assert poses


@pytest.mark.parametrize(
    ("text", "code", "reason"),
    [
        ("{bar: {size: [0.03, 0.03, 0.03], cells: [100, 100, 100]}, material: {}}", PARSE, "1000000 cells; allowed"),
        (CUBE.replace("material:", "at: [0, 0, 0], material:"), PARSE, "initial_pose states the place"),
        (CUBE.replace("neo_hookean", "jelly"), FAILED, "jelly"),
        (CUBE.replace(", density: 1070", ""), FAILED, "density"),
        ("{mesh: {bar: {}}, handles: {}, material: {}}", PARSE, "it has handles; allowed for a body that joins"),
        ("{mesh: {file: ../../x.msh}, material: {law: linear, young: 1, poisson: 0}}", FAILED, "x.msh"),
        ("{mesh: {file: /dev/zero}, material: {law: linear, young: 1, poisson: 0}}", FAILED, "zero"),
        ("{bar: {}, materials: {'a.b': {}}, regions: []}", PARSE, "a.b; allowed: letters"),
        ("{bar: {}, materials: [1], regions: []}", PARSE, "a mapping `materials`"),
    ],
)
def test_a_soft_body_that_cannot_join_is_refused(
    client: Any, bodies: _Bodies, text: str, code: int, reason: str
) -> None:
    """A defect is named with its code; the simulation goes on."""
    answer = bodies.spawn("gel", text).result
    assert (answer.result, reason in answer.error_message) == (code, True), answer.error_message
    assert bodies.names() == ["part"]
    _steps(client, 1)
    assert client.record().converged


def test_answers_to_strange_requests_are_short_and_whole(client: Any, bodies: _Bodies) -> None:
    """Names and URIs of a megabyte are not repeated, a null character does not end a reason, no reason is Python's."""
    from simulation_interfaces import srv

    long = bodies.ask("GetEntityState", "get_entity_state", entity="g" * 1_000_000).result.error_message
    assert "bodies: part" in long
    assert len(long) < 5000
    for uri in ("x" * 1_000_000 + ".yaml", "file:///a%00b.yaml", "file://[", "//[/x.yaml", "/nowhere.yaml"):
        for kind, service in (("SpawnEntity", "spawn_entity"), ("LoadWorld", "load_world")):
            request = getattr(srv, kind).Request(**({"name": "gel"} if kind == "SpawnEntity" else {}))
            (request.entity_resource if kind == "SpawnEntity" else request.world_resource).uri = uri
            result = client.call(getattr(srv, kind), service, request).result
            assert result.result != OK
            assert len(result.error_message) < 5000
            reasons = ("no file can", "File name too long", "null byte", "allowed: file", "No such file", "not exist")
            assert any(reason in result.error_message for reason in reasons), result.error_message
            assert not any(word in result.error_message for word in ("Error(", "Errno")), result.error_message


def test_a_body_that_joins_is_no_step_that_fails(client: Any, bodies: _Bodies) -> None:
    """The state after a spawn or a deletion says that no step has been made since, and the log warns of nothing."""
    _steps(client, 3)
    for change in (lambda: bodies.spawn("gel"), lambda: bodies.ask("DeleteEntity", "delete_entity", entity="gel")):
        before = client.record().step
        assert change().result.result == OK
        client.wait(lambda before=before: client.record().step > before)
        assert not client.record().converged
        assert client.record().message == "bodies joined or left, and no step has been made since"
        told = len(client.received["/diagnostics"])
        client.wait(lambda told=told: len(client.received["/diagnostics"]) > told + 1)
        _steps(client, 1)
        assert client.record().converged
    assert "did not converge" not in bodies.process.log

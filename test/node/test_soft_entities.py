# SPDX-License-Identifier: Apache-2.0
"""Soft bodies as entities of simulation_interfaces, and the services that answer what there is."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Vector3

from test.node.standard import Standard

CUBE = """{bar: {size: [0.03, 0.03, 0.03], cells: [2, 2, 2]},
  material: {law: neo_hookean, young: 1.0e5, poisson: 0.45, density: 1070}}"""
BOX = "{box: {size: [0.03, 0.03, 0.03]}, mass: 0.02}"
OK, FAILED, PARSE, NOT_UNIQUE, SOME_FAILED, UNSUPPORTED = 1, 4, 106, 101, 150, 0
PLACE = (0.3, 0.0, 0.2)


def test_a_soft_body_joins_falls_is_asked_and_leaves(client: Any, bodies: Standard) -> None:
    """A soft cube joins a moving scene, falls by g t^2 / 2, has tags, bounds and a modulus, and leaves again."""
    client.advance(3)
    before = client.mesh()
    spawned = bodies.spawn("gel", CUBE, PLACE)
    assert (spawned.result.result, spawned.entity_name) == (OK, "gel"), spawned.result.error_message
    assert "self_contact" in spawned.result.error_message
    client.wait(lambda: len(client.mesh()) == len(before) + 27)
    assert np.abs(client.mesh()[: len(before)] - before).max() == 0.0
    assert bodies.names() == ["part", "gel"]
    client.advance(4)
    assert bodies.state("gel").twist.linear.z == pytest.approx(-9.81 * 0.02, rel=1e-2)
    assert bodies.place("gel")[2] == pytest.approx(PLACE[2] - 0.5 * 9.81 * 0.02**2, abs=5e-4)
    info = bodies.ask("GetEntityInfo", entity="gel").info
    assert (list(info.tags), info.description) == (["soft", "spawned"], "a soft body of 8 cells")
    box = bodies.ask("GetEntityBounds", entity="gel").bounds
    corners = np.array([[each.x, each.y, each.z] for each in box.points])
    assert box.type == 1
    assert corners == pytest.approx(np.array([[0.03, 0.015, 0.015], [0.0, -0.015, -0.015]]), abs=1e-5)
    assert client.set(**{"materials.gel.young": 5.0e4})[0].successful
    client.advance(2)
    assert client.record().converged
    assert bodies.delete("gel") == OK
    client.wait(lambda: len(client.mesh()) == len(before))
    assert bodies.names() == ["part"]
    client.advance(2)
    assert client.record().converged


def test_a_soft_body_is_put_elsewhere_and_the_bag_repeats_it(
    client: Any, bodies: Standard, replays: Callable, tmp_path: Path
) -> None:
    """Its mean pose becomes the wanted one, its shape stays, and it falls from there; the bag replays to the bit."""
    assert bodies.spawn("gel", CUBE, PLACE).result.result == OK
    client.advance(2)
    client.set(bag_path=str(tmp_path / "bag"))
    client.switch("record", True)
    client.advance(2)
    before = client.mesh()[-27:, :3]
    state = bodies.state("gel")
    state.twist.linear.x = state.twist.linear.y = state.twist.linear.z = 0.0
    state.pose.position.x, state.pose.position.z = 0.5, 0.4
    state.pose.orientation.w = state.pose.orientation.z = 0.5**0.5
    code, reason = bodies.result("SetEntityState", entity="gel", state=state, set_pose=True)
    assert code == OK, reason
    client.advance()
    found = bodies.state("gel")
    assert (found.pose.position.x, found.pose.position.z) == pytest.approx((0.5, 0.4), abs=5e-4)
    assert found.pose.orientation.z == pytest.approx(0.5**0.5, abs=1e-4)
    assert found.twist.linear.z == pytest.approx(-9.81 * 0.005, rel=0.05)
    after = client.mesh()[-27:, :3]
    sides = [np.linalg.norm(each[:, None] - each[None], axis=2) for each in (before, after)]
    assert sides[1] == pytest.approx(sides[0], abs=2e-6)
    client.advance(2)
    assert client.record().converged
    state.pose.position.x, state.pose.position.z = 0.05, 0.0
    assert "inside of" in bodies.result("SetEntityState", entity="gel", state=state, set_pose=True)[1]
    state.twist.linear.z = 1.0
    code, reason = bodies.result("SetEntityState", entity="gel", state=state, set_twist=True)
    assert (code, "a velocity cannot be set" in reason) == (UNSUPPORTED, True)
    client.switch("record", False)
    replays(tmp_path / "bag")


def test_several_bodies_join_in_one_request(bodies: Standard) -> None:
    """Each entry has a result; a bad one does not hinder the others; states come with names, by filters."""
    wanted = [
        bodies.wanted("a", CUBE, PLACE),
        bodies.wanted("a", CUBE, (0.4, 0, 0.2)),
        bodies.wanted("b", "{bar: 3, material: {}}", PLACE),
        bodies.wanted("c", BOX, (0.5, 0, 0.2)),
    ]
    answer = bodies.ask("SpawnEntities", spawn_requests=wanted)
    assert answer.result.result == SOME_FAILED
    assert "2 of 4 joined; results[1]" in answer.result.error_message
    assert [each.result.result for each in answer.results] == [OK, NOT_UNIQUE, FAILED, OK]
    assert bodies.names() == ["part", "c", "a"]
    assert bodies.names(tags__tags=["soft"]) == ["a"]
    near = {"filters__bounds__type": 3, "filters__bounds__points": [Vector3(x=0.5, z=0.2), Vector3(x=0.05)]}
    states = bodies.ask("GetEntitiesStates", **near)
    assert list(states.entities) == ["c"]
    assert states.states[0].pose.position.x == pytest.approx(0.5)
    hull = {"filters__bounds__type": 2, "filters__bounds__points": [Vector3(x=0.3, z=0.2)]}
    assert bodies.result("GetEntities", **hull)[0] == UNSUPPORTED
    too_many = [bodies.wanted("x", BOX, PLACE)] * 101
    assert "allowed: up to 100" in bodies.result("SpawnEntities", spawn_requests=too_many)[1]
    assert bodies.reset(4)[0] == OK
    assert bodies.names() == ["part"]


def test_what_can_be_spawned_is_listed_and_can_be_spawned(client: Any, bodies: Standard, tmp_path: Path) -> None:
    """Each listed URI joins; folders in `sources` are listed without their subfolders; named poses have kinds."""
    (tmp_path / "more.yaml").write_text(BOX)
    (tmp_path / "more.txt").write_text(BOX)
    found = bodies.ask("GetSpawnables", sources=[str(tmp_path), "/nowhere"])
    uris = [each.uri for each in found.spawnables]
    assert [Path(uri).stem for uri in uris] == ["box", "soft_ball", "soft_cube", "more", "slab"]
    assert "/nowhere" in found.result.error_message
    for number, uri in enumerate(uris[:3]):
        place = (0.3 + 0.1 * number, 0.0, 0.2)
        answer = bodies.spawn(f"body{number}", "", place, entity_resource__uri=uri)
        assert answer.result.result == OK, answer.result.error_message
    client.advance()
    assert client.record().converged
    poses = bodies.ask("GetNamedPoses").poses
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
    client: Any, bodies: Standard, text: str, code: int, reason: str
) -> None:
    """A defect is named with its code; the simulation goes on."""
    answer = bodies.spawn("gel", text, PLACE).result
    assert (answer.result, reason in answer.error_message) == (code, True), answer.error_message
    assert bodies.names() == ["part"]
    client.advance()
    assert client.record().converged


def test_answers_to_strange_requests_are_short_and_whole(bodies: Standard) -> None:
    """Names and URIs of a megabyte are not repeated, a null character does not end a reason, no reason is Python's."""
    long = bodies.result("GetEntityState", entity="g" * 1_000_000)[1]
    assert "bodies: part" in long
    assert len(long) < 5000
    reasons = ("no file can", "File name too long", "null byte", "allowed: file", "No such file", "not exist")
    for uri in ("x" * 1_000_000 + ".yaml", "file:///a%00b.yaml", "file://[", "//[/x.yaml", "/nowhere.yaml"):
        spawn = bodies.result("SpawnEntity", name="gel", entity_resource__uri=uri)
        for code, told in (spawn, bodies.result("LoadWorld", world_resource__uri=uri)):
            assert code != OK
            assert len(told) < 5000
            assert any(reason in told for reason in reasons), told
            assert not any(word in told for word in ("Error(", "Errno")), told


def test_a_body_that_joins_is_no_step_that_fails(client: Any, bodies: Standard, falling_slab: Any) -> None:
    """The state after a spawn or a deletion says that no step has been made since, and the log warns of nothing."""
    client.advance(3)
    for change in (lambda: bodies.spawn("gel", CUBE, PLACE).result.result, lambda: bodies.delete("gel")):
        before = client.record().step
        assert change() == OK
        client.wait(lambda before=before: client.record().step > before)
        assert not client.record().converged
        assert client.record().message == "bodies joined or left, and no step has been made since"
        told = len(client.received["/diagnostics"])
        client.wait(lambda told=told: len(client.received["/diagnostics"]) > told + 1)
        client.advance()
        assert client.record().converged
    assert "did not converge" not in falling_slab.log

# SPDX-License-Identifier: Apache-2.0
"""Rigid bodies as entities of simulation_interfaces: spawned, deleted, listed, asked and put elsewhere."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from std_srvs.srv import SetBool

from gdfe_ros.scene import scene_from_text
from test.node.standard import Standard

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
ASIDE = (0.3, 0.0, 0.2)
NOT_UNIQUE, NAME_INVALID, FORMAT, NO_RESOURCE, NAMESPACE, PARSE, POSE = 101, 102, 103, 104, 105, 106, 109


def test_a_spawned_box_falls_onto_the_body_and_is_recorded(
    client: Any, bodies: Standard, replays: Callable, tmp_path: Path
) -> None:
    """A box from URDF joins a running simulation, falls onto the slab, and is part of a bag, which replays."""
    client.advance(3)
    spawned = bodies.spawn("", CUBE, at=(0.15, 0.0, 0.1))
    assert (spawned.result.result, spawned.entity_name) == (OK, "cube"), spawned.result.error_message
    assert bodies.names() == ["part", "cube"]
    assert bodies.names(filter="^cu") == ["cube"]
    assert bodies.place("cube")[2] == pytest.approx(0.1, abs=1e-12)
    client.set(bag_path=str(tmp_path / "bag"))
    client.switch("record", True)
    client.advance(4)
    assert bodies.state("cube").twist.linear.z == pytest.approx(-9.81 * 0.02, rel=0.2)
    assert bodies.place("cube")[2] == pytest.approx(0.1 - 0.5 * 9.81 * 0.02**2, abs=5e-4)
    assert "bag is being written" in bodies.spawn("second", CUBE, at=ASIDE).result.error_message
    client.switch("record", False)
    replays(tmp_path / "bag")


def test_bodies_that_stay_are_not_disturbed(client: Any, bodies: Standard) -> None:
    """Mesh and part move through a spawn and a deletion as they would without them; time goes on."""
    client.advance(4)
    assert bodies.spawn("cube", CUBE, at=ASIDE).result.result == OK
    client.advance(4)
    assert bodies.delete("cube") == OK
    client.advance(4)
    assert client.record().time == pytest.approx(0.06)
    found = client.mesh()
    client.trigger("reset")
    client.advance(12)
    client.wait(lambda: client.record().time == pytest.approx(0.06))
    assert np.abs(client.mesh() - found).max() < 1e-5


def test_spawned_bodies_go_with_a_reset(client: Any, bodies: Standard) -> None:
    """The scope of spawned bodies removes them and time goes on; a whole reset removes them and starts anew."""
    client.advance(2)
    places = ((0.3, 0, 0.2), (0.4, 0, 0.2))
    names = [bodies.spawn("box", CUBE, at=at, allow_renaming=True).entity_name for at in places]
    assert names == ["box", "box_2"]
    assert bodies.reset(4)[0] == OK
    assert bodies.names() == ["part"]
    assert float(client.status()["simulation time [s]"]) == pytest.approx(0.01)
    assert bodies.spawn("box", CUBE, at=ASIDE).result.result == OK
    assert bodies.reset(0)[0] == OK
    assert bodies.names() == ["part"]
    assert client.status()["simulation time [s]"] == "0"
    client.advance()


def test_a_body_is_put_elsewhere(client: Any, bodies: Standard) -> None:
    """The frame of a spawned body is the link's, also where it is put; bodies of the scene can be put, too."""
    assert bodies.spawn("cube", CUBE, at=ASIDE).result.result == OK
    for name, y in (("cube", 0.1), ("part", 0.3)):
        assert bodies.put(name, (0.4, y, 0.5))[0] == OK
        client.advance()
        assert bodies.place(name)[:2] == pytest.approx((0.4, y), abs=1e-6)
        assert bodies.place(name)[2] == pytest.approx(0.5, abs=1e-3)
    assert "inside of" in bodies.put("part", (0.4, 0.1, 0.5))[1]
    assert bodies.put("part", (1e300, 0.1, 0.5))[0] == POSE
    assert bodies.delete("part") == FAILED
    assert bodies.delete("nobody") == NOT_FOUND


def test_a_body_joins_while_the_clock_runs(client: Any, launch: Callable, slab: Path, standard: Standard) -> None:
    """With the wall clock the node goes on playing, or stays paused, after a body was spawned."""
    launch(scene=str(slab), clock="wall", rate=50.0, dt=0.005)
    assert standard.spawn("cube", CUBE, at=ASIDE).result.result == OK
    client.wait(lambda: standard.place("cube")[2] < 0.1)
    client.switch("pause", True)
    assert standard.spawn("late", CUBE, at=(0.5, 0, 0.2)).result.result == OK
    client.spin(0.3)
    assert standard.place("late")[2] == pytest.approx(0.2)
    client.switch("pause", False)
    client.wait(lambda: standard.place("late")[2] < 0.19)


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


def test_a_body_that_cannot_join_is_refused_soon(client: Any, bodies: Standard) -> None:
    """A defect, or a resource that would take hours to read, is named with its code; the simulation goes on."""
    for changes, code, text in REFUSED:
        began = time.monotonic()
        answer = bodies.spawn(**{"name": "", "text": CUBE, "at": ASIDE, **changes}).result
        client.state()
        assert time.monotonic() - began < PATIENCE
        assert (answer.result, text in answer.error_message) == (code, True), (changes, answer.error_message)
        assert bodies.names() == ["part"]
        client.advance(2)
        assert client.record().converged


def test_what_waits_for_the_next_step_survives_a_spawn(client: Any, bodies: Standard) -> None:
    """A teleport and a queued command that were accepted before a spawn take effect after it; steps count on."""
    client.advance(2)
    assert bodies.put("part", (0.4, 0.3, 0.5))[0] == OK
    assert bodies.spawn("cube", CUBE, at=ASIDE).result.result == OK
    client.advance()
    assert bodies.place("part")[0] == pytest.approx(0.4, abs=1e-6)
    assert int(client.status()["steps"]) >= 4


def test_a_finished_bag_does_not_begin_again(
    client: Any, launch: Callable, slab: Path, standard: Standard, tmp_path: Path
) -> None:
    """With `record` true, a spawn after the bag was finished begins no bag, whether it succeeds or not."""
    launch(scene=str(slab), clock="lockstep", dt=0.005, record=True, bag_path=str(tmp_path / "bag"))
    client.switch("record", False)
    assert standard.spawn("low", CUBE, at=(0.05, 0.05, 0.0)).result.result == FAILED
    assert standard.spawn("high", CUBE, at=ASIDE).result.result == OK
    client.advance(2)
    assert "not recording" in client.call(SetBool, "record", SetBool.Request(data=False)).message
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith("bag")] == ["bag"]


def test_a_modulus_set_during_a_spawn_stays(client: Any, bodies: Standard) -> None:
    """A Young's modulus that is set while the new scene is prepared holds afterwards."""
    assert client.set(**{"materials.soft.young": 2.1e5})[0].successful  # the service is known from now on
    kind = bodies.srv.SpawnEntity
    service = client.node.create_client(kind, client.full("spawn_entity"))
    client.wait(service.service_is_ready)
    names = [f"box{i}" for i in range(3)]
    wanted = [bodies.wanted(name, CUBE, (0.3 + 0.1 * place, 0.0, 0.2)) for place, name in enumerate(names)]
    waiting = [
        service.call_async(kind.Request(**{key: getattr(body, key) for key in body.get_fields_and_field_types()}))
        for body in wanted
    ]
    assert client.set(**{"materials.soft.young": 2.5e5})[0].successful
    assert not all(answer.done() for answer in waiting)
    client.wait(lambda: all(answer.done() for answer in waiting), seconds=60.0)
    assert [answer.result().result.result for answer in waiting] == [OK, OK, OK]
    assert set(bodies.names()) == {"part", *names}
    last = client.wait(lambda: all(name in client.last("scene").data for name in names) and client.last("scene"))
    assert scene_from_text(last.data).materials["soft"].young == 2.5e5


@pytest.mark.parametrize(
    ("pattern", "code"),
    [(r"^(\w+_?)+!$", UNSUPPORTED), ("(", FAILED), (".*" * 10 + "!$", UNSUPPORTED), ("a" * 1000, UNSUPPORTED)],
)
def test_expressions_that_could_be_matched_forever_are_refused(bodies: Standard, pattern: str, code: int) -> None:
    """An expression that is wrong, too long, or could be matched forever, is refused."""
    assert bodies.result("GetEntities", filters__filter=pattern)[0] == code


def test_a_scene_without_dynamics_takes_no_bodies(
    client: Any, launch: Callable, coarse: dict, standard: Standard
) -> None:
    """In statics a body cannot move; the answer says so. An unknown scope of a reset is refused."""
    launch(**coarse, clock="lockstep")
    answer = standard.spawn("", CUBE).result
    assert (answer.result, "no `dynamics`" in answer.error_message) == (FAILED, True)
    assert "unknown bits" in standard.reset(8)[1]

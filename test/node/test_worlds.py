# SPDX-License-Identifier: Apache-2.0
"""Worlds of simulation_interfaces: scenes are loaded into a running node, listed, and unloaded."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from test.node.standard import Standard

OK, INCORRECT, FORMAT, NO_RESOURCE, PARSE, NO_WORLD, SOURCES = 1, 3, 101, 102, 103, 101, 101
STOPPED, PLAYING, STATE_NO_WORLD = 0, 1, 4
TEXT = """
name: other
mesh: {bar: {size: [0.1, 0.02, 0.02], cells: [5, 1, 1]}}
materials: {soft: {law: neo_hookean, young: 2.0e5, poisson: 0.45}}
regions: [{material: soft}]
handles: {base: {where: {face: x-}, fixed: true}, tip: {where: {face: x+}}}
"""
LARGE = TEXT.replace("[5, 1, 1]", "[50, 10, 10]")
"""A world that takes longer to load than the slab takes for a step."""


def _state(standard: Standard) -> int:
    return standard.ask("GetSimulationState").state.state


def test_a_world_is_loaded_while_the_old_one_steps(
    client: Any, start: Callable, slab: Path, standard: Standard
) -> None:
    """The old scene makes steps until the new one is ready; the new one is stopped at time 0, and can be played."""
    start(scene=str(slab), clock="fast")
    client.wait(lambda: client.records() and client.records()[-1].time > 0.05)  # all kernels are compiled
    service = client.node.create_client(standard.srv.LoadWorld, client.full("load_world"))
    client.wait(service.service_is_ready)
    request = standard.srv.LoadWorld.Request()
    request.world_resource.resource_string = LARGE
    before, answer = client.record().time, service.call_async(request)
    client.wait(lambda: answer.done() or client.record().time > before)
    second = standard.ask("LoadWorld", world_resource__resource_string=LARGE)
    client.wait(answer.done)
    assert any(record.time > before for record in client.records()), "the old scene made no step in the meantime"
    answers = answer.result(), second  # of two clients: either may arrive first, and the first may be ready by then
    assert any(each.result.result == OK for each in answers), [each.result.error_message for each in answers]
    for each in answers:
        if each.result.result == OK:
            assert each.world.name == "other"
            assert each.world.world_resource.resource_string == LARGE
        else:
            assert each.result.result == INCORRECT
            assert "another world is being loaded" in each.result.error_message
    assert _state(standard) == STOPPED
    assert client.state() == "active"
    client.wait(lambda: "name: other" in client.last("scene").data)
    assert standard.result("SetSimulationState", state__state=PLAYING)[0] == OK
    assert _state(standard) == PLAYING
    client.wait(lambda: client.received["mesh"] and len(client.mesh()) == 51 * 11 * 11)


def test_worlds_are_listed_unloaded_and_loaded_by_file(client: Any, bodies: Standard, tmp_path: Path) -> None:
    """A scene's file, and a name in config/scenes, can be loaded into a node without a world; defects are named."""
    found = bodies.ask("GetAvailableWorlds", additional_sources=[str(tmp_path)])
    uris = {each.name: each.world_resource.uri for each in found.worlds}
    assert {"bend5", "gripper", "slab"} <= uris.keys()
    code, reason = bodies.result("GetAvailableWorlds", additional_sources=["/nowhere"])
    assert (code, "/nowhere" in reason) == (SOURCES, True)
    for given, code, reason in (
        ({}, NO_RESOURCE, "are empty"),
        ({"uri": "http://x/y.yaml"}, FORMAT, "allowed: file:///path"),
        ({"uri": "/dev/zero"}, FORMAT, ".yaml"),
        ({"uri": "/nowhere.yaml"}, PARSE, "does not exist"),
        ({"resource_string": "name: a"}, PARSE, "mesh"),
        ({"resource_string": TEXT.replace("{bar:", "{file: mesh.msh, bar:")}, PARSE, "mesh"),
    ):
        found, told = bodies.result("LoadWorld", **{f"world_resource__{key}": value for key, value in given.items()})
        assert (found, reason in told) == (code, True), told
    client.advance()  # the present scene goes on
    assert bodies.ask("GetCurrentWorld").world.world_resource.uri == uris["slab"]
    assert bodies.result("UnloadWorld")[0] == OK
    assert (client.state(), _state(bodies)) == ("unconfigured", STATE_NO_WORLD)
    assert bodies.result("UnloadWorld")[0] == NO_WORLD
    assert bodies.result("GetCurrentWorld")[0] == NO_WORLD
    loaded = bodies.ask("LoadWorld", world_resource__uri=uris["slab"])
    assert (loaded.result.result, loaded.world.name) == (OK, "slab"), loaded.result.error_message
    assert _state(bodies) == STOPPED
    client.advance()
    features = bodies.ask("GetSimulatorFeatures").features.features
    assert {0, 1, 2, 4, 5, 6, 8, 9, 10, 11, 12, 14, 40, 41, 43, 44, 45, 50} <= set(features)
    assert not {3, 7, 13, 21, 22, 42} & set(features)

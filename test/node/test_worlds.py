# SPDX-License-Identifier: Apache-2.0
"""Worlds of simulation_interfaces: scenes are loaded into a running node, listed, and unloaded."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from std_srvs.srv import Trigger

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


class _Worlds:
    """A client of the services for worlds."""

    def __init__(self, client: Any) -> None:
        from simulation_interfaces import srv

        self._client, self.srv = client, srv

    def ask(self, kind: str, service: str, **fields: Any) -> Any:
        return self._client.call(getattr(self.srv, kind), service, getattr(self.srv, kind).Request(**fields))

    def request(self, uri: str = "", text: str = "") -> Any:
        found = self.srv.LoadWorld.Request()
        found.world_resource.uri, found.world_resource.resource_string = uri, text
        return found

    def load(self, uri: str = "", text: str = "") -> Any:
        return self._client.call(self.srv.LoadWorld, "load_world", self.request(uri, text))

    def state(self) -> int:
        return self.ask("GetSimulationState", "get_simulation_state").state.state


def test_a_world_is_loaded_while_the_old_one_steps(
    client: Any, start: Callable, slab: Path, interfaces: Callable
) -> None:
    """The old scene makes steps until the new one is ready; the new one is stopped at time 0, and can be played."""
    interfaces("simulation_interfaces")
    worlds = _Worlds(client)
    start(scene=str(slab), clock="fast")
    client.wait(lambda: client.records() and client.records()[-1].time > 0.05)  # all kernels are compiled
    service = client.node.create_client(worlds.srv.LoadWorld, client.full("load_world"))
    client.wait(service.service_is_ready)
    before, answer = client.record().time, service.call_async(worlds.request(text=LARGE))
    client.wait(lambda: answer.done() or client.record().time > before)
    second = worlds.load(text=LARGE)
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
    assert worlds.state() == STOPPED
    assert client.state() == "active"
    client.wait(lambda: "name: other" in client.last("scene").data)
    request = worlds.srv.SetSimulationState.Request()
    request.state.state = PLAYING
    assert client.call(worlds.srv.SetSimulationState, "set_simulation_state", request).result.result == OK
    assert worlds.state() == PLAYING
    client.wait(lambda: client.received["mesh"] and len(client.mesh()) == 51 * 11 * 11)


def test_worlds_are_listed_unloaded_and_loaded_by_file(
    client: Any, start: Callable, slab: Path, interfaces: Callable, tmp_path: Path
) -> None:
    """A scene's file, and a name in config/scenes, can be loaded into a node without a world; defects are named."""
    interfaces("simulation_interfaces")
    worlds = _Worlds(client)
    start(scene=str(slab), clock="lockstep", dt=0.005)
    client.wait(client.records)
    found = worlds.ask("GetAvailableWorlds", "get_available_worlds", additional_sources=[str(tmp_path)])
    uris = {each.name: each.world_resource.uri for each in found.worlds}
    assert {"bend5", "gripper", "slab"} <= uris.keys()
    wrong = worlds.ask("GetAvailableWorlds", "get_available_worlds", additional_sources=["/nowhere"])
    assert (wrong.result.result, "/nowhere" in wrong.result.error_message) == (SOURCES, True)
    for given, code, reason in (
        ({}, NO_RESOURCE, "are empty"),
        ({"uri": "http://x/y.yaml"}, FORMAT, "allowed: file:///path"),
        ({"uri": "/dev/zero"}, FORMAT, ".yaml"),
        ({"uri": "/nowhere.yaml"}, PARSE, "does not exist"),
        ({"text": "name: a"}, PARSE, "mesh"),
        ({"text": TEXT.replace("{bar:", "{file: mesh.msh, bar:")}, PARSE, "mesh"),
    ):
        answer = worlds.load(**given).result
        assert (answer.result, reason in answer.error_message) == (code, True), answer.error_message
    assert client.call(Trigger, "step", Trigger.Request()).success  # the present scene goes on
    assert worlds.ask("GetCurrentWorld", "get_current_world").world.world_resource.uri == uris["slab"]
    assert worlds.ask("UnloadWorld", "unload_world").result.result == OK
    assert (client.state(), worlds.state()) == ("unconfigured", STATE_NO_WORLD)
    assert worlds.ask("UnloadWorld", "unload_world").result.result == NO_WORLD
    assert worlds.ask("GetCurrentWorld", "get_current_world").result.result == NO_WORLD
    loaded = worlds.load(uri=uris["slab"])
    assert (loaded.result.result, loaded.world.name) == (OK, "slab"), loaded.result.error_message
    assert worlds.state() == STOPPED
    assert client.call(Trigger, "step", Trigger.Request()).success
    features = worlds.ask("GetSimulatorFeatures", "get_simulator_features").features.features
    assert {0, 1, 2, 4, 5, 6, 8, 9, 10, 11, 12, 14, 40, 41, 43, 44, 45, 50} <= set(features)
    assert not {3, 7, 13, 21, 22, 42} & set(features)

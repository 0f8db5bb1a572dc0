# SPDX-License-Identifier: Apache-2.0
"""Services: reset, pause, step, record, save and load a state; and changes of moduli."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from std_srvs.srv import SetBool, Trigger

from gdfe_ros.analysis.bag_run import BagRun
from gdfe_ros.recording.step import Begin


def _trigger(client: Any, name: str) -> tuple[bool, str]:
    response = client.call(Trigger, name, Trigger.Request())
    return response.success, response.message


def _switch(client: Any, name: str, on: bool) -> tuple[bool, str]:
    response = client.call(SetBool, name, SetBool.Request(data=on))
    return response.success, response.message


def test_services_say_why_not(client: Any, start: Callable, coarse: dict) -> None:
    """Services of an unconfigured or running node that refuse give their reason."""
    start(**coarse, autostart=False)
    assert _trigger(client, "reset") == (False, "the node is unconfigured; call the transition `configure` first")
    assert client.transition("configure")
    assert "not active" in _switch(client, "pause", True)[1]
    assert client.transition("activate")
    assert "pause it with ~/pause" in _trigger(client, "step")[1]
    assert _switch(client, "record", False) == (False, "the node is not recording already")
    assert "has no actuators" in _trigger(client, "compute_jacobian")[1]
    assert "state_path is empty" in _trigger(client, "save_state")[1]
    client.set(state_path="/nonexistent/state.bin")
    assert "cannot be read" in _trigger(client, "load_state")[1]


def test_reset_goes_back_to_rest_at_time_zero(client: Any, start: Callable, coarse: dict) -> None:
    """A reset of a lifted tip leads to time 0 without displacement, says so in the record, and commands work again."""
    start(**coarse, clock="lockstep")
    client.target(0.1)
    client.wait_steps(2)
    client.trigger("reset")
    client.wait_steps(3)
    record = client.record()
    assert (record.step, record.time, record.begin, record.energy < 1e-12) == (2, 0.0, Begin.REST, True)
    assert abs(client.mesh()[:, 3:]).max() < 1e-6
    client.target(0.1)
    client.wait_steps(4)
    assert np.array_equal(client.meshes()[3], client.meshes()[1])


def test_a_paused_node_steps_on_demand_only(client: Any, launch: Callable, coarse: dict) -> None:
    """In a paused node commands wait; ~/step makes the requested steps and answers after they are published."""
    launch(**coarse, step_count=3, heartbeat=0.0)
    assert client.switch("pause", True) == "paused"
    client.target(0.1)
    client.wait_taken(1)
    count = int(client.diagnostics()["steps"])
    client.wait_steps(count)
    client.trigger("step")
    client.wait_steps(count + 3)
    records = client.records()[-3:]
    assert [bool(record.handles) for record in records] == [True, False, False]
    np.testing.assert_allclose([record.dt for record in records], 0.01)
    assert client.diagnostics()["clock"] == "paused"
    assert client.switch("pause", False) == "running"
    client.target(0.11)
    client.wait_steps(count + 4)


def test_a_bag_begun_in_the_middle_replays_from_the_state_it_holds(
    client: Any, start: Callable, coarse: dict, replays: Callable, tmp_path: Path
) -> None:
    """A bag started between commands has a state and records that reproduce its meshes bit for bit."""
    process = start(**coarse, clock="lockstep", bag_path=str(tmp_path / "bag"))
    for z in (0.01, 0.02, 0.04):
        client.target(z)
    client.wait_steps(4)
    client.switch("record", True)
    assert "already" in _switch(client, "record", True)[1]
    assert client.set(**{"materials.e20.young": 3e4})[0].reason.startswith("a bag is being written")
    for z in (0.05, 0.06, 0.03):
        client.target(z)
    client.wait_steps(8)
    assert client.switch("record", False).endswith(" 0 dropped")
    process.stop()
    begins = [record.begin for record in BagRun(tmp_path / "bag").records]
    assert begins == [Begin.LOADED, Begin.LAST, Begin.LAST, Begin.LAST]
    assert ("mesh", "x") in replays(tmp_path / "bag")


def test_a_saved_state_is_gone_on_from_bit_for_bit(client: Any, start: Callable, coarse: dict, tmp_path: Path) -> None:
    """After a saved state is loaded, the same commands give the same meshes bit for bit."""
    start(**coarse, clock="lockstep", state_path=str(tmp_path / "folder" / "state.bin"))
    for z in (0.01, 0.02):
        client.target(z)
    client.wait_steps(3)
    client.trigger("save_state")
    for z in (0.03, 0.05):
        client.target(z)
    client.wait_steps(5)
    client.trigger("load_state")
    for z in (0.03, 0.05):
        client.target(z)
    client.wait_steps(8)
    assert client.records()[5].begin is Begin.LOADED
    assert [record.time for record in client.records()][2:] == [0.02, 0.03, 0.04, 0.02, 0.03, 0.04]
    for first, second in ((2, 5), (3, 6), (4, 7)):
        assert np.array_equal(client.meshes()[first], client.meshes()[second])


def test_a_modulus_is_a_parameter(client: Any, start: Callable, coarse: dict) -> None:
    """Five times the modulus of the softest segment, under the same command, increases the reaction; the pose stays."""
    start(**coarse, clock="lockstep")
    client.target(0.05)
    client.wait_steps(2)
    assert not client.set(**{"materials.e20.young": 0.0})[0].successful
    assert client.set(**{"materials.e20.young": 1e5})[0].successful
    client.wait_steps(3)
    client.wait(lambda: len(client.received["handles/tip/wrench"]) == 3)
    client.wait(lambda: "young: 100000.0" in client.last("scene").data)
    before, after = (message.wrench.force.z for message in client.received["handles/tip/wrench"][1:])
    assert after > 1.5 * before
    assert client.mesh()[:, 5].max() == client.meshes()[-2][:, 5].max()
    assert client.record().time == client.records()[-2].time

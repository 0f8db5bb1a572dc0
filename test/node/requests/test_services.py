# SPDX-License-Identifier: Apache-2.0
"""Services: reset, pause, step, record, save and load a state; and changes of moduli."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from std_srvs.srv import SetBool, Trigger


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

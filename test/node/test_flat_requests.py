# SPDX-License-Identifier: Apache-2.0
"""Requests of simulation_interfaces 1.5, which have `uri` and `resource_string` in the request itself.

Two versions of a message package cannot be loaded by one process, so that all requests are sent by `gdfe call`.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

DATA = Path(__file__).parents[1] / "data"
CUBE = """{bar: {size: [0.03, 0.03, 0.03], cells: [2, 2, 2]},
  material: {law: neo_hookean, young: 1.0e5, poisson: 0.45, density: 1070}}"""
PLACE = {"pose": {"position": {"x": 0.3, "y": 0.0, "z": 0.2}, "orientation": {"w": 1.0}}}
OK, FAILED, NO_RESOURCE = 1, 4, 104
WORLD_NO_RESOURCE = 102


@pytest.fixture
def flat(
    pytestconfig: pytest.Config, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, build_interfaces: Callable
) -> None:
    """Make version 1.5 importable in processes that are started afterwards."""
    definitions = tmp_path / "simulation_interfaces"
    for version in ("interfaces", "interfaces_1_5"):
        shutil.copytree(DATA / version / "simulation_interfaces", definitions, dirs_exist_ok=True)
    place = build_interfaces(definitions, Path(pytestconfig.cache.mkdir("interfaces_1_5")))
    monkeypatch.syspath_prepend(place)  # for forked nodes; this process must not import it
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, [place, os.environ.get("PYTHONPATH")])))


@pytest.fixture
def ask(flat: None, falling_slab: Any) -> Callable[..., dict[str, Any]]:
    """Start a node, and give a function that calls one of its services and returns the answer."""
    tool = str(Path(sys.executable).with_name("gdfe"))

    def call(service: str, **request: Any) -> dict[str, Any]:
        command = [tool, "call", f"/gdfe_sim/{service}", json.dumps(request)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=120.0, check=False)
        assert done.returncode in (0, 1), done.stderr
        found = yaml.safe_load(done.stdout)
        assert isinstance(found, dict), (done.returncode, done.stdout, done.stderr)
        return found

    return call


def test_a_body_is_spawned_by_flat_fields_and_put_elsewhere(client: Any, ask: Callable, tmp_path: Path) -> None:
    """A text and a file at a URI become bodies; a state without flags sets the pose; defects have their codes."""
    found = ask("spawn_entity", name="gel", resource_string=CUBE, initial_pose=PLACE)
    assert (found["result"]["result"], found["entity_name"]) == (OK, "gel"), found
    file = tmp_path / "box.yaml"
    file.write_text("{box: {size: [0.03, 0.03, 0.03]}, mass: 0.02}", encoding="utf-8")
    far = {"pose": {"position": {"x": 0.5, "y": 0.0, "z": 0.2}, "orientation": {"w": 1.0}}}
    found = ask("spawn_entity", name="box", uri=file.as_uri(), initial_pose=far)
    assert (found["result"]["result"], found["entity_name"]) == (OK, "box"), found
    assert ask("spawn_entity", name="other", initial_pose=PLACE)["result"]["result"] == NO_RESOURCE
    wrong = ask("spawn_entity", name="other", resource_string="{bar: 3, material: {}}", initial_pose=PLACE)
    assert wrong["result"]["result"] == FAILED
    moved = {"pose": {"position": {"x": 0.3, "y": 0.2, "z": 0.4}, "orientation": {"w": 1.0}}}
    assert ask("set_entity_state", entity="gel", state=moved)["result"]["result"] == OK
    client.advance()
    place = ask("get_entity_state", entity="gel")["state"]["pose"]["position"]
    assert (place["x"], place["y"]) == pytest.approx((0.3, 0.2), abs=1e-4)
    assert place["z"] == pytest.approx(0.4, abs=1e-3)


def test_a_world_is_loaded_by_flat_fields(ask: Callable) -> None:
    """A name in `uri`, and a text in `resource_string`; the current world and the list have flat fields, too."""
    assert ask("load_world")["result"]["result"] == WORLD_NO_RESOURCE
    found = ask("load_world", uri="bend5")
    assert (found["result"]["result"], found["world"]["name"]) == (OK, "bend5"), found
    current = ask("get_current_world")["world"]
    assert current["uri"].endswith("/bend5.yaml")
    first = ask("get_available_worlds")["worlds"][0]
    assert (first["name"], first["uri"].startswith("file://")) == ("arm_grasp", True)
    text = Path(current["uri"].removeprefix("file://")).read_text(encoding="utf-8").replace("name: bend5", "name: mine")
    found = ask("load_world", resource_string=text)
    assert (found["result"]["result"], found["world"]["name"], found["world"]["uri"]) == (OK, "mine", "")

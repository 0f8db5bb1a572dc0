# SPDX-License-Identifier: Apache-2.0
"""Parameter files and the command line, read by a real node."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from rcl_interfaces.srv import GetParameters, ListParameters, SetParameters
from rclpy.parameter import Parameter, parameter_value_to_python

from gdfe_ros.testing import forking
from gdfe_ros.testing.client import await_discovery

ROOT = Path(__file__).parents[2]
COARSE = {"scene": "bend5", "scene_overrides": ["mesh.bar.cells=[10, 1, 1]"], "clock": "lockstep"}


class Node:
    """A ``sim_node`` with another name in a namespace, and its parameter services."""

    def __init__(self, ros: Any, place: str, log: Path, words: list[str]) -> None:
        self._ros, self._client, self._name = ros, ros.node(f"asker_{place}"), f"/{place}/arm"
        names = ["-r", f"__ns:=/{place}", "-r", "__node:=arm"]
        self.process = forking.start(["--ros-args", *names, *words], log, os.environ)

    def call(self, kind: type, service: str, request: Any) -> Any:
        """Call a service of the node."""
        client = self._client.create_client(kind, f"{self._name}/{service}")
        self._wait(client.service_is_ready)
        await_discovery(self._client, self._name, self._wait)
        future = client.call_async(request)
        self._wait(future.done)
        return future.result()

    def names(self) -> list[str]:
        """Return the parameter names, once the scene is configured."""
        listed: list[str] = []

        def configured() -> bool:
            listed[:] = self.call(ListParameters, "list_parameters", ListParameters.Request()).result.names
            return any(name.startswith("materials.") for name in listed)

        self._wait(configured)
        return listed

    def values(self, *names: str) -> list[Any]:
        """Return the values of parameters."""
        answer = self.call(GetParameters, "get_parameters", GetParameters.Request(names=list(names)))
        return [parameter_value_to_python(value) for value in answer.values]

    def set(self, name: str, value: Any) -> Any:
        """Set a parameter; return the result."""
        request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
        return self.call(SetParameters, "set_parameters", request).results[0]

    def _wait(self, done: Callable[[], Any]) -> None:
        self._ros.wait(done, alive=lambda: self.process.poll() is None)


@pytest.fixture
def start(ros: Any, tmp_path: Path) -> Iterator[Callable[..., Node]]:
    """Give a function that starts the node with command-line arguments; the node is ended after the test."""
    started: list[Node] = []

    def make(*words: str) -> Node:
        place = f"left_{len(started)}"
        started.append(Node(ros, place, tmp_path / f"{place}.log", list(words)))
        return started[-1]

    yield make
    for node in started:
        node.process.kill()
        node.process.wait()


def _file(path: Path, **values: Any) -> str:
    path.write_text(yaml.safe_dump({"/**": {"ros__parameters": values}}))
    return str(path)


def test_moduli_come_from_a_file_and_from_the_command_line(start: Callable[..., Node], tmp_path: Path) -> None:
    """Moduli come from a file and the command line, also as integers; the command line has priority."""
    path = _file(tmp_path / "own.yaml", **COARSE, **{"materials.e20.young": 41000, "materials.e40.young": 43e3})
    node = start("--params-file", path, "-p", "materials.e40.young:=44000")
    node.names()
    assert node.values("materials.e20.young", "materials.e40.young", "materials.e60.young") == [41e3, 44e3, 60e3]
    assert node.set("materials.e20.young", 42000).successful
    refused = node.set("materials.e20.young", 0)
    assert not refused.successful
    assert "materials.e20.young is 0; allowed: 1 to 1e+12 Pa" in refused.reason


def test_a_dump_restores(start: Callable[..., Node], tmp_path: Path) -> None:
    """A node started with another node's parameter dump has the same values."""
    node = start(
        "--params-file", str(ROOT / "config" / "sim.yaml"), "--params-file", _file(tmp_path / "a.yaml", **COARSE)
    )
    names = node.names()
    assert node.set("materials.e20.young", 31e3).successful
    assert node.set("rate", 20).successful
    before = dict(zip(names, node.values(*names), strict=True))
    assert before["materials.e20.young"] == 31e3
    dump = {name: value for name, value in before.items() if not name.startswith("start_type_")}
    node = start("--params-file", _file(tmp_path / "dump.yaml", **dump))
    node.names()
    assert dict(zip(dump, node.values(*dump), strict=True)) == dump

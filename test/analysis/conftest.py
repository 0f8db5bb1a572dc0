# SPDX-License-Identifier: Apache-2.0
"""Bags as the node writes them, made in this process with its messages and its recorder, without its threads."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import String

from gdfe_ros.analysis.bag_run import BagRun
from gdfe_ros.analysis.message_values import cloud_values
from gdfe_ros.constraints import Pose
from gdfe_ros.live.bag import StepBag
from gdfe_ros.node.interface import topics
from gdfe_ros.recording.bag_info import TopicInfo
from gdfe_ros.recording.provenance import RunInfo
from gdfe_ros.recording.reader import BagMessage, BagReader
from gdfe_ros.recording.step import Begin, Step, make_record, observe, to_nanoseconds
from gdfe_ros.recording.writer import BagWriter
from gdfe_ros.results.step_result import StepResult
from gdfe_ros.scene import Scene, load_scene
from gdfe_ros.simulation import Command, Simulation

COARSE = {"mesh.bar.cells": [10, 1, 1], "solver.tolerance": 1e-8}


class BagMaker:
    """Records steps of a simulation in this process as a node does.

    Args:
        path: directory of the bag.
        scene: scene to simulate.
        node: name of the imitated node.
    """

    def __init__(self, path: Path, scene: Scene, *, node: str = "gdfe_sim") -> None:
        self.scene, self.simulation = scene, Simulation(scene)
        settings = {"node": {}, "state": None}
        self._bag = StepBag(path, scene, node=node, settings=settings, texts={topics.SCENE: scene.source})
        self._count, self._begin = 0, Begin.REST

    def step(self, handles: Mapping[str, Pose] | None = None, *, dt: float = 0.01) -> None:
        """Make a step with targets of handles, and write its messages."""
        command = Command(handles=dict(handles or {}))
        self._write(self.simulation.step(command, dt=dt), command, dt)

    def repeat(self, count: int, *, dt: float = 0.01) -> None:
        """Write the last step ``count`` times more, without solving."""
        result = self.simulation.result
        for number in range(1, count + 1):
            self._write(replace(result, time=result.time + number * dt), Command(), dt)

    def reset(self) -> None:
        """Reset the simulation; the next step continues from the undeformed state."""
        self.simulation.reset()
        self._begin = Begin.REST

    def skip(self) -> None:
        """Leave out the number of a step, as a lost record does."""
        self._count += 1

    def close(self) -> Path:
        """Complete the bag; return its directory."""
        self._bag.close()
        return self._bag.path

    def _write(self, result: StepResult, command: Command, dt: float) -> None:
        stamp = to_nanoseconds(result.time)
        record = make_record(result, command, step=self._count, begin=self._begin, dt=dt, stamp=stamp)
        self._bag.write(Step(record=record, result=result, log_time=stamp, **observe(self.simulation)))
        self._count, self._begin = self._count + 1, Begin.LAST

    @staticmethod
    def coarse() -> Scene:
        """Return bend5 on a coarse mesh."""
        return load_scene("bend5", overrides=COARSE)


@pytest.fixture
def maker() -> type[BagMaker]:
    """Return the class that writes bags."""
    return BagMaker


@pytest.fixture
def make_bag(tmp_path: Path) -> Callable[..., Path]:
    """Give a function that lifts the tip of bend5 step by step and returns the bag."""

    def make(name: str = "bag", *, heights: Iterable[float] = np.linspace(0.0, 0.1, 6), **overrides: Any) -> Path:
        changes = {key.replace("__", "."): value for key, value in overrides.items()}
        bag = BagMaker(tmp_path / name, load_scene("bend5", overrides={**COARSE, **changes}))
        for z in heights:
            bag.step({"tip": Pose(translation=(0.0, 0.0, float(z)))})
        return bag.close()

    return make


ROD = """
name: rod
mesh: {voxels: {surface: rod.stl, cell: 0.005, cells: cut}}
skin: {file: rod.stl}
materials: {soft: {law: neo_hookean, young: 1.0e5, poisson: 0.45}}
regions: [{material: soft}]
handles: {base: {where: {face: x-}, fixed: true}, tip: {where: {face: x+}}}
"""


@pytest.fixture
def rod(tmp_path: Path) -> Scene:
    """Return the scene of a rod of voxels with a skin."""
    surface = trimesh.creation.capsule(height=0.05, radius=0.01, count=[24, 24])
    surface.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0]))
    surface.export(tmp_path / "rod.stl")
    (tmp_path / "rod.yaml").write_text(ROD)
    return load_scene(tmp_path / "rod.yaml")


def unchanged(given: Any) -> Any:
    """Return what is given."""
    return given


def rewrite(
    bag: Path,
    out: Path,
    *,
    run: Callable[[RunInfo], RunInfo] = unchanged,
    topic: Callable[[TopicInfo], TopicInfo] = unchanged,
    record: Callable[[str], str] = unchanged,
    order: Callable[[list[BagMessage]], list[BagMessage]] = unchanged,
) -> Path:
    """Write a bag again with changed contents, whose checksums are right; return the new bag."""
    reader = BagReader(bag)
    named = {name: topic(info) for name, info in reader.topics.items()}
    writer = BagWriter(out, list(named.values()), run=run(reader.run))
    for message in order(list(reader.messages())):
        data = message.data
        if message.topic.endswith("/step_record"):
            data = serialize_message(String(data=record(deserialize_message(data, String).data)))
        writer.write(named[message.topic].name, data, message.log_time)
    writer.close({})
    return out


def last_positions(run: BagRun) -> np.ndarray:
    """Return the positions (n, 3) [m] of the last mesh message of a bag."""
    *_, last = (cloud_values(message) for message in run.messages("mesh"))
    return np.stack([last[axis] for axis in "xyz"], axis=1)

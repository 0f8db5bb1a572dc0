# SPDX-License-Identifier: Apache-2.0
"""Bags as the node writes them, made in this process with its messages and its recorder, without its threads."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from rclpy.serialization import serialize_message
from std_msgs.msg import String

from gdfe_ros.constraints import Pose
from gdfe_ros.node import messages
from gdfe_ros.recording.bag_info import TopicInfo
from gdfe_ros.recording.packing import Packer
from gdfe_ros.recording.provenance import RunInfo
from gdfe_ros.recording.published import MESH, STRAIN, WRENCH, write_mesh, write_strain, write_wrench
from gdfe_ros.recording.step import Begin, StepRecord, to_nanoseconds
from gdfe_ros.recording.writer import BagWriter
from gdfe_ros.scene import Scene, load_scene
from gdfe_ros.simulation import Command, Simulation

COARSE = {"mesh.bar.cells": [10, 1, 1], "solver.tolerance": 1e-8}
_OUTCOMES = [
    "converged",
    "iterations",
    "substeps",
    "error_estimate",
    "energy",
    "min_det",
    "wall_time",
    "skipped",
    "message",
]
_OUTCOMES += ["energies"]


class BagMaker:
    """Makes steps of a scene and writes the node's messages.

    Args:
        path: directory of the bag.
        scene: scene to simulate.
        node: full name of the imitated node.
        rename: dict from a topic's name without the node's to its full name.
    """

    def __init__(
        self, path: Path, scene: Scene, *, node: str = "/gdfe_sim", rename: Mapping[str, str] | None = None
    ) -> None:
        self.scene, self.simulation, self._node = scene, Simulation(scene), node
        kinds = {"step_record": "std_msgs/msg/String", "mesh": "sensor_msgs/msg/PointCloud2"}
        kinds |= {"strain": "sensor_msgs/msg/PointCloud2", "scene": "std_msgs/msg/String"}
        for name in self.simulation.handle_names:
            kinds[f"handles/{name}/pose"] = "geometry_msgs/msg/PoseStamped"
            kinds[f"handles/{name}/wrench"] = "geometry_msgs/msg/WrenchStamped"
        settings = {**asdict(scene.solver), "policy": scene.solver.policy.value}
        self._rename = dict(rename or {})
        topics = [TopicInfo(name=self._full(name), type=kind) for name, kind in kinds.items()]
        self._writer = BagWriter(path, topics, run=RunInfo(scene=scene.source, settings=settings))
        self._count, self._begin = 0, Begin.REST
        sizes = {"mesh": (MESH, scene.mesh.n_vertices), "strain": (STRAIN, scene.mesh.n_cells), "wrench": (WRENCH, 1)}
        self._packers = {name: Packer(kind, "base_link", count) for name, (kind, count) in sizes.items()}
        self._send("scene", String(data=scene.source), 0)

    def step(self, handles: Mapping[str, Pose] | None = None, *, dt: float = 0.01) -> None:
        """Make a step and write its messages, the mesh before the record; `repeat` writes the record first."""
        handles = dict(handles or {})
        result = self.simulation.step(Command(handles=handles), dt=dt)
        outcome = {name: getattr(result, name) for name in _OUTCOMES}
        moment, rest = to_nanoseconds(result.time), self.scene.mesh.vertices
        record = StepRecord(
            step=self._count, begin=self._begin, time=result.time, dt=dt, stamp=moment, handles=handles, **outcome
        )
        self._count, self._begin = self._count + 1, Begin.LAST
        head = messages.header(moment, "base_link")
        self._send("mesh", self._pack("mesh", moment, write_mesh, result.positions, rest), moment)
        self._send("step_record", String(data=record.to_json()), moment)
        self._send("strain", self._pack("strain", moment, write_strain, self.simulation.fields()), moment)
        for name in self.simulation.handle_names:
            self._send(f"handles/{name}/pose", messages.pose_stamped(head, self.simulation.handle_pose(name)), moment)
            self._send(
                f"handles/{name}/wrench", self._pack("wrench", moment, write_wrench, result.reactions[name]), moment
            )

    def repeat(self, count: int, *, dt: float = 0.01) -> None:
        """Write the present state as ``count`` further steps, without solving."""
        result, fields, rest = self.simulation.result, self.simulation.fields(), self.scene.mesh.vertices
        for number in range(1, count + 1):
            time = result.time + number * dt
            outcome = {name: getattr(result, name) for name in _OUTCOMES}
            moment = to_nanoseconds(time)
            record = StepRecord(step=self._count, begin=Begin.LAST, time=time, dt=dt, stamp=moment, **outcome)
            self._count += 1
            self._send("step_record", String(data=record.to_json()), moment)
            self._send("mesh", self._pack("mesh", moment, write_mesh, result.positions, rest), moment)
            self._send("strain", self._pack("strain", moment, write_strain, fields), moment)

    def reset(self) -> None:
        """Reset the simulation to the undeformed state."""
        self.simulation.reset()
        self._begin = Begin.REST

    def skip(self) -> None:
        """Skip a step's number, as if its record had been dropped."""
        self._count += 1

    def close(self) -> Path:
        """Complete the bag and return its directory."""
        self._writer.close({"messages_dropped": "0"})
        return self._writer.path

    def _pack(self, kind: str, moment: int, write: Callable[..., None], *numbers: Any) -> bytes:
        return self._packers[kind].pack(moment, lambda rows: write(rows, *numbers))

    def _send(self, topic: str, message: Any, moment: int) -> None:
        data = message if isinstance(message, bytes) else serialize_message(message)
        self._writer.write(self._full(topic), data, moment)

    def _full(self, topic: str) -> str:
        return self._rename.get(topic, f"{self._node}/{topic}")

    @staticmethod
    def coarse() -> Scene:
        """Load a scene that is solved in a millisecond."""
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

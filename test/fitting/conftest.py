# SPDX-License-Identifier: Apache-2.0
"""Small scenes that are solved in milliseconds, and recordings of them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gdfe_ros.live.bag import LiveBag
from gdfe_ros.recording.step import Begin, Step, StepRecord, observe
from gdfe_ros.scene import scene_from_text
from gdfe_ros.simulation import Command, Simulation

PULLED = """\
name: pulled
mesh: {bar: {size: [0.1, 0.02, 0.02], cells: [5, 1, 1]}}
materials: {rubber: {law: neo_hookean, young: 2.0e5, poisson: 0.45, density: 1070}}
regions: [{material: rubber}]
handles: {base: {where: {face: x-}, fixed: true}}
loads: {pull: {point: {at: [0.1, 0, 0], force: [0, 0, -0.05]}}}
probes: {tip: [0.1, 0, 0]}
"""
SWINGING = PULLED.replace("name: pulled", "name: swinging") + "dynamics: {step: 0.01, damping: {viscosity: 300.0}}\n"


@pytest.fixture
def write_scene(tmp_path: Path) -> Callable[..., str]:
    """Give a function that writes a scene file and returns its path."""

    def write(text: str = PULLED, name: str = "scene") -> str:
        path = tmp_path / f"{name}.yaml"
        path.write_text(text)
        return str(path)

    return write


@pytest.fixture
def write_table(tmp_path: Path) -> Callable[..., Path]:
    """Give a function that simulates and writes a CSV file of load factors and tip positions [mm]."""

    def write(
        text: str = PULLED,
        name: str = "run",
        *,
        count: int = 30,
        noise: float = 0.01,
        unit: str = "mm",
        dt: float = 0.01,
        seed: int = 1,
        most: float = 2.0,
    ) -> Path:
        simulation, rng = Simulation(scene_from_text(text)), np.random.default_rng(seed)
        factors = np.linspace(0.1, most, count) if simulation.scene.dynamics is None else np.ones(count)
        places = []
        for factor in factors:
            simulation.step(Command(loads={"pull": float(factor)}), dt=dt)
            places.append(simulation.probe_positions()["tip"])
        found = np.array(places)
        found += noise * np.ptp(found, axis=0).max() * rng.standard_normal(found.shape)
        path = tmp_path / f"{name}.csv"
        rows = [
            ",".join(f"{value:.9g}" for value in (dt * (k + 1), factor, *(1e3 * place)))
            for k, (factor, place) in enumerate(zip(factors, found, strict=True))
        ]
        head = ",".join(["time [s]", "pull", *(f"tip.{axis} [{unit}]" for axis in "xyz")])
        path.write_text("\n".join([head, *rows, ""]))
        return path

    return write


@pytest.fixture
def record_bag(tmp_path: Path) -> Callable[..., Path]:
    """Give a function that records a run as the node does, with noise added to the simulated positions."""

    def record(text: str = PULLED, name: str = "bag", *, count: int = 30, noise: float = 0.01, seed: int = 2) -> Path:
        scene = scene_from_text(text, overrides={"solver.tolerance": 1e-8})
        simulation, rng = Simulation(scene), np.random.default_rng(seed)
        bag = LiveBag(tmp_path / name, scene, state=None, dt=0.01)
        span = 0.02
        pack = bag._packs["probe/tip"]

        def disturbed(step: Step) -> bytes:
            data = bytearray(pack(step))
            place = np.frombuffer(data, "<f8", 3, len(data) - 56)  # the pose is at the end of the message
            place += noise * span * rng.standard_normal(3)
            return bytes(data)

        bag._packs["probe/tip"] = disturbed
        for number in range(count):
            command = Command(loads={"pull": 2.0 * (number + 1) / count})
            result = simulation.step(command, dt=0.01)
            begin = Begin.LAST if number else Begin.REST
            stamp = round(result.time * 1e9)
            record = StepRecord(
                step=number, begin=begin, time=result.time, dt=0.01, stamp=stamp, loads=dict(command.loads)
            )
            bag.write(Step(result=result, record=record, log_time=stamp, **observe(simulation)))
        bag.close()
        return bag.path

    return record

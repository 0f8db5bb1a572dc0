# SPDX-License-Identifier: Apache-2.0
"""Behaviour of a session apart from its page."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pytest
import trimesh

from gdfe_ros.live.session import LiveSession, RestingPace
from gdfe_ros.live.surface import DrawnSurface
from gdfe_ros.node.driving.orders import ActuatorOrder
from gdfe_ros.scene import load_scene, scene_from_text
from gdfe_ros.simulation import Simulation


def test_time_stands_while_there_is_nothing_to_do() -> None:
    """After an hour without work, the next step covers one dt, and a later overrun is still counted."""
    now = [0.0]
    pace = RestingPace({"rate": 100.0, "dt": 0.01, "heartbeat": 0.0, "publish_clock": False}, lambda: now[0])
    assert pace.begin() == 0.01
    assert pace.delay(pending=False, settled=True) is None
    now[0] = 3600.0
    assert pace.delay(pending=True, settled=True) == 0.0
    assert pace.begin() == 0.01
    now[0] += 0.035
    assert (pace.begin(), pace.overruns) == (0.01, 2)


def test_a_rate_limit_holds_after_a_rest(bar: str) -> None:
    """With a rate limit, the first step after a pause changes a tension by at most rate times dt."""
    text = bar.replace("left: {cable: {", "left: {cable: {rate: 1.0, ")
    simulation = Simulation(scene_from_text(text, origin="of a test"))
    steps: list[Any] = []
    session = LiveSession(simulation, on_view=steps.append)
    session.start()
    session.stepper.post(lambda: None).result()
    session.command("left", ActuatorOrder({"left": 2.0}))
    while len(steps) < 2:
        session.stepper.post(lambda: None).result()
    session.stop()
    assert dict((name, value) for name, value, _ in steps[1].actuators["left"])["tension"] == pytest.approx(0.01)


def test_a_program_that_turns_too_far_in_a_step_ends_with_a_warning() -> None:
    """A program that turns a handle by 4 rad in one step ends there, instead of turning it back."""
    turn = {"program.handles": {"tip": [{"time": 0.0}, {"time": 1.0, "rotation_deg": [230.0, 0.0, 0.0]}]}}
    simulation, told = Simulation(load_scene("bend5", overrides={"mesh.bar.cells": [10, 1, 1], **turn})), []
    session = LiveSession(simulation, dt=simulation.scene.program.duration, warn=told.append)
    session.start()
    session.play()
    session.stepper.post(lambda: None).result()
    session.stop()
    assert told[0].startswith("the program ends here: handle 'tip' is commanded to turn by 4.014 rad in one step")
    assert simulation.targets["tip"].rotation == (0.0, 0.0, 0.0)


def test_the_surface_is_a_sound_gltf() -> None:
    """A packed bent body is read by trimesh: vertices in the picture's units, colours and triangles."""
    mesh = load_scene("bend5", overrides={"mesh.bar.cells": [10, 2, 2]}).mesh
    surface = DrawnSurface(mesh, scale=10.0)
    positions = np.add(mesh.vertices, [0.0, 0.0, 0.01])
    shares = np.linspace(0.0, 1.0, surface.count)
    (read,) = trimesh.load(
        io.BytesIO(surface.pack(positions, shares)), file_type="glb", process=False
    ).geometry.values()
    np.testing.assert_allclose(read.vertices, 10.0 * surface.outside.at(positions), atol=1e-6)
    np.testing.assert_array_equal(read.faces, surface.triangles)
    assert read.is_watertight
    assert read.volume == pytest.approx(1000.0 * np.prod(np.ptp(mesh.vertices, axis=0)), rel=1e-5)


def test_fields_of_cells_are_averaged_at_the_vertices() -> None:
    """A cell field's value at a vertex is the mean over the faces there; a constant field stays constant."""
    mesh = load_scene("bend5", overrides={"mesh.bar.cells": [10, 2, 2]}).mesh
    surface = DrawnSurface(mesh)
    np.testing.assert_allclose(surface.outside.average(np.full(mesh.n_cells, 3.0)), 3.0)
    along = surface.outside.average(mesh.centroids[:, 0])
    inner = np.isclose(surface.outside.at(mesh.vertices)[:, 0], np.median(np.unique(mesh.vertices[:, 0])))
    np.testing.assert_allclose(along[inner], np.median(np.unique(mesh.vertices[:, 0])), atol=1e-12)

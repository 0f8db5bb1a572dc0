# SPDX-License-Identifier: Apache-2.0
"""Scenery in pictures: cables, obstacles, chambers and contact forces around the body."""

import base64
from io import BytesIO
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from gdfe_ros import Simulation, load_scene
from gdfe_ros.analysis.bag_run import BagStep
from gdfe_ros.analysis.picture import CABLE, FORCE, draw_body
from gdfe_ros.analysis.report.animation import Surroundings
from gdfe_ros.analysis.scenery import ARROW, Scenery
from gdfe_ros.recording.step import Begin, StepRecord
from gdfe_ros.results.contacts import contact_points
from test.written import scene_of


@pytest.fixture(scope="module")
def pressing() -> Simulation:
    """Return the shipped finger, pressing on its plate."""
    simulation = Simulation(load_scene("finger_press"))
    for result in simulation.play():
        if result.time >= 2.5:
            break
    return simulation


def coloured(simulation: Simulation, scenery: Scenery, colour: tuple[float, float, float]) -> int:
    """Return the number of pixels in a picture that have nearly this colour."""
    picture = BytesIO()
    values = np.zeros(simulation.mesh.n_cells)
    draw_body(picture, simulation.mesh, simulation.positions, values, title="", label="", scenery=scenery)
    picture.seek(0)
    return int((np.abs(matplotlib.image.imread(picture)[..., :3] - colour).max(axis=2) < 0.05).sum())


def test_cables_and_forces_are_drawn(pressing: Simulation) -> None:
    """The tendon and the plate's forces each cover hundreds of pixels, and none without scenery."""
    scenery = Scenery.of(pressing)
    for colour in (CABLE, FORCE):
        assert coloured(pressing, scenery, colour) > 100
        assert coloured(pressing, Scenery(), colour) == 0


def test_forces_are_those_of_the_step(pressing: Simulation) -> None:
    """The drawn forces sum to the plate's force on the finger and act at the contact points."""
    scenery, touch = Scenery.of(pressing), pressing.result.contacts["plate"]
    np.testing.assert_allclose(scenery.forces.sum(axis=0), touch.forces.sum(axis=0), atol=1e-6)
    np.testing.assert_allclose(scenery.places, touch.places, atol=1e-8)
    assert len(scenery.cables) == 1
    assert [faces.shape for faces in scenery.obstacles] == [(6, 4, 3)]


def test_a_recorded_step_has_the_same_scenery(pressing: Simulation) -> None:
    """Recorded contact points give the same forces; a bag without contact points gives none."""
    points = contact_points(pressing.result.contacts)
    samples = {"contacts": {name: points[name] for name in points.dtype.names}}
    found = Scenery.from_samples(pressing.scene, samples, pressing.positions)
    assert np.array_equal(found.forces, Scenery.of(pressing).forces)
    assert len(Scenery.from_samples(pressing.scene, {}, pressing.positions).forces) == 0
    assert "contacts" in list(Scenery.topics(pressing.scene))


def test_a_page_has_the_same_scenery(pressing: Simulation) -> None:
    """Two frames packed for a page unpack to plate, tendon and forces within a fraction of a millimetre."""
    points = contact_points(pressing.result.contacts)
    samples = {"contacts": {name: points[name] for name in points.dtype.names}}
    record = StepRecord(step=0, begin=Begin.LAST, time=0.0, dt=0.0, stamp=0)
    surroundings, size = Surroundings(pressing.scene), pressing.mesh.size
    surroundings.add(BagStep(record, (0, 0), {}), pressing.mesh.vertices)
    surroundings.add(BagStep(record, (1, 0), samples), pressing.positions)
    description, arrays = surroundings.to_page()
    scenery, low, high = Scenery.of(pressing), np.array(description["low"]), np.array(description["high"])

    def decoded(kind: str) -> np.ndarray:
        levels = np.frombuffer(base64.b64decode(arrays[f"around-{kind}"]), dtype="<u2").reshape(-1, 3)
        return low + levels / 65535 * (high - low)

    close = {"rtol": 0.0, "atol": 2.0 * (high - low).max() / 65535}
    second = slice(description["counts"]["cables"], None)
    np.testing.assert_allclose(decoded("cables")[second], scenery.cables[0], **close)
    assert description["counts"] == {"solids": 6 * 6, "chambers": 0, "cables": len(scenery.cables[0])}
    faces = decoded("solids")[36:].reshape(2, 6, 3, 3)
    np.testing.assert_allclose(faces[0], scenery.obstacles[0][:, :3], **close)
    largest = np.linalg.norm(scenery.forces, axis=1).max()
    assert (description["forces"][0], description["largest"]) == (0, pytest.approx(largest))
    arrows = decoded("forces").reshape(-1, 2, 3)
    assert 2 * len(arrows) == description["forces"][1]
    assert np.linalg.norm(arrows[:, 1] - arrows[:, 0], axis=1).max() == pytest.approx(ARROW * size, rel=1e-3)


def test_chambers_are_drawn_where_they_are(tmp_path: Path) -> None:
    """The drawn faces of a chamber enclose its volume."""
    simulation = Simulation(load_scene("pneunet"))
    (faces, *_) = Scenery.of(simulation).chambers
    a, b, c, d = np.moveaxis(faces, 1, 0)
    volume = sum(np.einsum("fi,fi->", p, np.cross(q, r)) for p, q, r in ((a, b, c), (a, c, d))) / 6.0
    (chamber,) = simulation.actuator_states().values()
    assert abs(volume) == pytest.approx(chamber.extent, rel=1e-6)


BARS = """
meshes:
  near: {bar: {size: [0.1, 0.02, 0.02], cells: [20, 4, 4]}, at: [0, -0.03, 0]}
  far: {bar: {size: [0.1, 0.02, 0.04], cells: [20, 4, 8]}, at: [0, 0.03, 0]}
materials: {soft: {law: neo_hookean, young: 1.0e5, poisson: 0.4}}
handles: {ends: {where: {any: [{mesh: near, face: x-}, {mesh: far, face: x-}]}, fixed: true}}
obstacles: {ball: {sphere: {radius: 0.018}, at: [0.05, 0, 0.01]}}
self_contact: {}
"""


def test_a_ball_between_two_bars_is_behind_one_and_before_the_other() -> None:
    """A ball between two bars tints the farther bar only."""
    simulation = Simulation(scene_of(BARS))
    values = simulation.mesh.vertices[simulation.mesh.cells].mean(axis=1)[:, 1] > 0.0
    pictures = []
    for scenery in (Scenery.of(simulation), Scenery()):
        picture = BytesIO()
        around = np.vstack([faces.reshape(-1, 3) for faces in Scenery.of(simulation).obstacles])
        given = {"title": "", "label": "", "around": around, "scenery": scenery}
        draw_body(picture, simulation.mesh, simulation.positions, values.astype(float), **given)
        picture.seek(0)
        pictures.append(matplotlib.image.imread(picture)[:, :1100, :3])
    with_ball, without = pictures
    tinted, red, green, blue = np.abs(with_ball - without).max(axis=2) > 0.02, *np.moveaxis(without, 2, 0)
    near, far = (blue > green + 0.1) & (red < 0.4), (red > 0.5) & (green > 0.5) & (blue < 0.3)
    assert (tinted & far).sum() > 0.02 * far.sum() > 100
    assert (tinted & near).sum() < 0.01 * near.sum()

# SPDX-License-Identifier: Apache-2.0
"""Contact points and contact sensors, without ROS."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros import Command, Pose, Simulation
from gdfe_ros.errors import SceneError
from gdfe_ros.results.contacts import POINT, contact_names, contact_points, total_forces
from test.written import scene_of

SLAB = """
mesh: {bar: {size: [0.1, 0.1, 0.04], cells: [4, 4, 1]}}
materials: {soft: {law: neo_hookean, young: 2.0e5, poisson: 0.4, density: 1000}}
handles: {base: {where: {face: z-}, fixed: true}}
obstacles:
  lid: {plane: [0, 0, -1], at: [0, 0, 0.021], friction: 0.3}
  far: {sphere: {radius: 0.01}, at: [0, 0, 1]}
sensors:
  left: {where: {box: {x: [0.0, 0.05], z: [0.019, 0.021]}}}
  right: {where: {box: {x: [0.05, 0.1], z: [0.019, 0.021]}}}
"""
BODIES = """
bodies:
  one: {box: {size: [0.02, 0.02, 0.02]}, density: 800, at: [0.05, 0.0, -0.1]}
  two: {box: {size: [0.02, 0.02, 0.02]}, density: 800, at: [0.05, 0.0, -0.2]}
dynamics: {scheme: bdf2, step: 0.005}
"""


def test_sensors_share_what_a_lid_presses() -> None:
    """Under a pressed lid, the sensors of both halves have equal forces; a vertex of both counts in both.

    Their moments are about the sensors' centres.
    """
    simulation = Simulation(scene_of(SLAB))
    assert not simulation.scene.sensors["left"].wrench(simulation.step()).any()
    result = simulation.step(Command(handles={"lid": Pose((0.0, 0.0, -0.003))}))
    left, right = (simulation.scene.sensors[name].wrench(result) for name in ("left", "right"))
    np.testing.assert_allclose(left[2], right[2], rtol=1e-3)
    points = contact_points(result.contacts)
    on_both = np.abs(simulation.mesh.vertices[points["vertex"], 0] - 0.05) < 1e-9
    np.testing.assert_allclose(left[2] + right[2], result.reactions["lid"][2] + points["fz"][on_both].sum(), rtol=1e-5)
    assert left[2] < -1.0
    assert left[4] == pytest.approx(-right[4], rel=1e-2)
    assert abs(left[4]) < 0.0125 * abs(left[2])


def test_what_begins_inside_is_pushed_out_by_the_first_step() -> None:
    """With a lid 1 mm inside the slab the first state is not settled; after one step the slab is below the lid."""
    simulation = Simulation(scene_of(SLAB, overrides={"obstacles.lid.at": [0, 0, 0.019]}))
    assert not simulation.settled
    touch = simulation.step().contacts["lid"]
    assert simulation.settled
    assert len(touch.vertices) == 25
    assert touch.gaps.min() > -1e-5
    assert touch.presses.sum() > 1.0


def test_what_lies_on_the_body_has_not_begun_inside() -> None:
    """A lid that starts on the slab is settled."""
    simulation = Simulation(scene_of(SLAB, overrides={"obstacles.lid.at": [0, 0, 0.020]}))
    assert simulation.settled
    assert simulation.step().iterations == 0


def test_names_are_those_of_the_results() -> None:
    """The contact names of obstacles and two rigid bodies are those of the simulation, in its order."""
    simulation = Simulation(scene_of(SLAB + BODIES))
    names = contact_names(simulation.scene.handles)
    assert names == list(simulation.step().contacts)
    assert names[-3:] == ["two on lid", "two on far", "two on one"]


def test_the_force_on_a_table_counts_rigid_bodies() -> None:
    """The total force on a lid that carries a box is the box' weight; the reaction, of the slab only, is zero."""
    box = {"one": {"box": {"size": [0.02, 0.02, 0.02]}, "density": 800, "at": [0.05, 0.0, -0.05]}}
    lid = {"lid": {"plane": [0, 0, 1], "at": [0, 0, -0.06], "friction": 0.3}}
    more = {"loads.weight": {"gravity": [0, 0, -9.81]}, "dynamics": {"scheme": "bdf2", "step": 0.005}}
    given = {"obstacles": lid, "bodies": box, "sensors": {}, "handles.base.where": {"face": "z+"}, **more}
    simulation = Simulation(scene_of(SLAB, overrides=given))
    for _ in range(20):
        result = simulation.step(dt=0.005)
    totals = total_forces(contact_points(result.contacts), simulation.scene.handles)
    weight = 800 * 0.02**3 * 9.81
    assert totals["lid"] == pytest.approx([0.0, 0.0, -weight], abs=1e-3 * weight)
    assert totals["one"] == pytest.approx([0.0, 0.0, weight], abs=1e-3 * weight)
    assert not result.reactions["lid"].any()


def test_nothing_touches_where_there_is_nothing_to_touch() -> None:
    """Without contacts there are no points, in an array of the right type."""
    points = contact_points({})
    assert (len(points), points.dtype, contact_names(())) == (0, POINT, [])


def test_a_sensor_without_faces_is_refused() -> None:
    """A sensor without boundary faces is refused with its key in the file and the extent of the mesh."""
    with pytest.raises(SceneError, match=r"sensors\.left\.where[\s\S]*no boundary face is there; the mesh spans"):
        scene_of(SLAB, overrides={"sensors.left.where": {"box": {"x": [1.0, 2.0]}}})

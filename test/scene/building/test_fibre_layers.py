# SPDX-License-Identifier: Apache-2.0
"""Layers of fibres in a scene file: the chosen faces, and named defects."""

from __future__ import annotations

import numpy as np
import pytest

from gdfe_ros import Command, Simulation
from gdfe_ros.errors import SceneError
from gdfe_ros.scene import Scene, scene_from_text
from gdfe_ros.scene.solvable import refuse_unsolvable
from gdfe_ros.solver.settings import Policy, SolverSettings
from test.written import advance

_TUBE = """
name: tube
mesh: {{tube: {{inner: 0.008, outer: 0.01, length: 0.05, cells: [1, 16, 10], cap: 0.002, cap_cells: 1}}}}
materials: {{soft: {{law: neo_hookean, young: 1.0e5, poisson: 0.45, density: 1100}}}}
regions: [{{material: soft}}]
handles: {{base: {{where: {{face: x-}}, fixed: true}}}}
actuators: {{air: {{chamber: {{cavity: 0}}}}}}
fibres: {{layer: {{{layer}}}}}
{more}
"""
_SIDE = "where: {box: {x: [1.0e-4, 0.0499]}}, along: [1, 0, 0], stiffness: 1.0e4"


def _tube(layer: str, more: str = "") -> Scene:
    return scene_from_text(_TUBE.format(layer=layer, more=more))


@pytest.mark.parametrize(("wall", "radius"), [("outer", 0.01), ("inner", 0.008)])
def test_fibres_are_on_one_wall(wall: str, radius: float) -> None:
    """A layer covers the chosen wall within its place: the perimeter of 16 edges times the length there."""
    scene = _tube(f"wall: {wall}, where: {{box: {{x: [0.0021, 0.0479]}}}}, along: [1, 0, 0], stiffness: 1.0e4")
    x = np.unique(np.round(scene.mesh.vertices[:, 0], 9))
    x = x[(x >= 0.0021) & (x <= 0.0479)]
    area = sum(family.areas.sum() for family in scene.fibres[0].families)
    assert area == pytest.approx(16 * 2.0 * radius * np.sin(np.pi / 16) * (x[-1] - x[0]), rel=1e-9)


def test_the_length_of_the_direction_does_not_matter() -> None:
    """A direction of any length gives the same fibres."""
    short = _tube(_SIDE.replace("[1, 0, 0]", "[1.0e-200, 0, 0]")).fibres[0]
    np.testing.assert_array_equal(short.families[0].factors, _tube(_SIDE).fibres[0].families[0].factors)


def test_fibres_stiffen_a_motion_and_a_saved_text_rebuilds_them() -> None:
    """With dynamics a tube with hoops swells less under pressure than a bare one; the text of the scene keeps them."""
    widths = []
    for layer in (f"{_SIDE}, angles_deg: [90]", _SIDE.replace("1.0e4", "1.0e-3")):
        scene = _tube(layer, "dynamics: {step: 0.005, damping: {viscosity: 500}}")
        simulation = Simulation(scene_from_text(scene.source))
        advance(simulation, Command(actuators={"air": 1500.0}), dt=0.005, count=20)
        middle = np.abs(simulation.mesh.vertices[:, 0] - 0.025) < 0.005
        widths.append(np.linalg.norm(simulation.positions[middle, 1:], axis=1).max())
    assert widths[0] < 0.01003
    assert widths[1] > 0.0104


@pytest.mark.parametrize(
    ("layer", "message"),
    [
        ("along: [0, 0, 0], stiffness: 1", "must not be zero"),
        ("along: [1, 0, 0], stiffness: 0", "0 < Young's modulus times thickness"),
        (f"{_SIDE}, ".replace("1.0e4", "1.0e9") + "angles_deg: [90]", "times the softest Young's modulus"),
        ("along: [1, 0, 0], angles_deg: [], stiffness: 1", "angles_deg"),
        ("along: [1, 0, 0], stiffness: 1", "faces are perpendicular to this direction, the first at"),
        ("where: {box: {x: [1, 2]}}, along: [1, 0, 0], stiffness: 1", "no boundary face is there"),
        ("wall: inner, where: {face: x-}, along: [0, 1, 0], stiffness: 1", "no face of the inner wall is there"),
        ("wall: middle, along: [0, 1, 0], stiffness: 1", "outer"),
    ],
)
def test_defects_of_a_layer_are_named(layer: str, message: str) -> None:
    """A layer that cannot be made is refused with its key and a remedy."""
    with pytest.raises(SceneError, match=r"fibres") as error:
        _tube(layer)
    assert message in str(error.value)


def test_names_policies_and_voxels_that_do_not_fit_are_named() -> None:
    """A taken name, the policy without forces, and the steps of voxels are refused."""
    with pytest.raises(SceneError, match=r"fibres\.layer.*has this name"):
        _tube(_SIDE, "loads: {layer: {gravity: [0, 0, -9.81]}}")
    with pytest.raises(SceneError, match=r"cannot take .*fibres"):
        refuse_unsolvable(_tube(_SIDE), SolverSettings(policy=Policy.RELATIVE))

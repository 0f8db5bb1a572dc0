# SPDX-License-Identifier: Apache-2.0
"""A follower pressure on a face with free edges, beside FElupe's own pressure on triquadratic hexahedra."""

from __future__ import annotations

import felupe
import numpy as np
import pytest

from gdfe_ros import Command, Simulation
from test.written import scene_of

LENGTH, WIDTH, YOUNG, POISSON, PRESSURE = 0.1, 0.02, 3.0e5, 0.4, 1200.0
SCENE = f"""
mesh: {{bar: {{size: [{LENGTH}, {WIDTH}, {WIDTH}], cells: [4, 4, 4]}}}}
materials: {{soft: {{law: neo_hookean, young: {YOUNG}, poisson: {POISSON}, density: 1000}}}}
handles: {{base: {{where: {{face: x-}}}}}}
loads: {{p: {{pressure: {{where: {{face: z+}}, pressure: {PRESSURE}}}}}}}
probes: {{tip: [{LENGTH}, 0, 0]}}
"""


def _felupe_tip(cells: tuple[int, ...]) -> np.ndarray:
    """Return the displacement of the tip [m] in FElupe, which computes in mm and MPa here."""
    length, half, young = 1e3 * LENGTH, 0.5e3 * WIDTH, 1e-6 * YOUNG
    mesh = felupe.Cube(a=(0, -half, -half), b=(length, half, half), n=tuple(count + 1 for count in cells))
    mesh = mesh.add_midpoints_edges().add_midpoints_faces().add_midpoints_volumes()
    field = felupe.FieldContainer([felupe.Field(felupe.RegionTriQuadraticHexahedron(mesh), dim=3)])
    lame = young * POISSON / ((1.0 + POISSON) * (1.0 - 2.0 * POISSON))
    law = felupe.NeoHookeCompressible(mu=young / (2.0 * (1.0 + POISSON)), lmbda=lame)
    region = felupe.RegionTriQuadraticHexahedronBoundary(
        mesh, only_surface=True, mask=np.isclose(mesh.points[:, 2], half)
    )
    pressed = felupe.SolidBodyPressure(felupe.FieldContainer([felupe.Field(region, dim=3)]))
    bounds = {"base": felupe.Boundary(field[0], fx=0.0)}
    held, moving = felupe.dof.partition(field, bounds)
    options = {"dof0": held, "dof1": moving, "ext0": felupe.dof.apply(field, bounds, held), "verbose": 0}
    for pressure in np.linspace(0.0, 1e-6 * PRESSURE, 5)[1:]:
        pressed.update(pressure)
        found = felupe.newtonraphson(items=[felupe.SolidBody(law, field), pressed], **options)
        assert found.success
    tip = np.flatnonzero(np.isclose(mesh.points, [length, 0.0, 0.0]).all(axis=1))
    return 1e-3 * found.x[0].values[tip[0]]


@pytest.mark.parametrize(
    ("cells", "within"), [((10, 2, 2), 0.01), pytest.param((20, 4, 4), 0.0025, marks=pytest.mark.slow)]
)
def test_a_bar_bends_under_a_follower_pressure_as_in_felupe(cells: tuple[int, ...], within: float) -> None:
    """The tip is FElupe's, with twice as many cells in each direction, where the bar has turned by about 90 degrees."""
    simulation = Simulation(scene_of(SCENE.replace("[4, 4, 4]", str([2 * count for count in cells]))))
    for factor in (0.25, 0.5, 0.75, 1.0):
        assert simulation.step(Command(loads={"p": factor})).converged
    moved = simulation.probe_positions()["tip"] - [LENGTH, 0.0, 0.0]
    assert moved[2] < -0.6 * LENGTH
    np.testing.assert_allclose(moved, _felupe_tip(cells), atol=within * LENGTH)

# SPDX-License-Identifier: Apache-2.0
"""The mass matrix: the kinetic energy of motions of all vertices, with attached masses."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from gdfe_ros import Simulation

BODY, LOAD, PLACE = 0.04, 0.25, np.array([0.073, 0.004, -0.006])
"""Mass of the bar [kg], the attached mass [kg], and its position [m] inside a cell, at none of the vertices."""


def loaded(moving: Callable[..., Simulation], **overrides: object) -> Simulation:
    """Return the bar with the attached mass."""
    given = {"probes": {"camera": PLACE.tolist()}, "masses": {"load": {"mass": LOAD, "probe": "camera"}}}
    return moving(**given, **overrides)


@pytest.mark.parametrize("spin", [(0.0, 0.0, 0.0), (0.0, 0.0, 3.0), (1.0, -2.0, 0.5)])
def test_a_mass_on_a_probe_has_the_kinetic_energy_of_a_point(moving: Callable, spin: tuple) -> None:
    """The loaded bar has the energy 1/2 m v^2 + 1/2 w I w of a box and a point mass about their common centre."""
    thrown = loaded(moving, handles={}, dynamics__velocity=[0.3, 0.0, -0.1], dynamics__spin=list(spin))
    middle = np.array([0.05, 0.0, 0.0])
    centre = (BODY * middle + LOAD * PLACE) / (BODY + LOAD)
    expected = 0.5 * (BODY + LOAD) * 0.1
    for mass, away in ((BODY, middle - centre), (LOAD, PLACE - centre)):
        expected += 0.5 * mass * np.sum(np.cross(spin, away) ** 2)
    squares = np.array([0.1, 0.02, 0.02]) ** 2
    expected += 0.5 * BODY / 12.0 * np.dot(squares.sum() - squares, np.square(spin))
    found = thrown.stepper.energies(thrown.stepper.at_rest())["kinetic"]
    assert found == pytest.approx(expected, rel=1e-12)


@pytest.mark.exact("an exact zero without a shift")
def test_a_mass_on_a_probe_falls_as_the_body_does(moving: Callable) -> None:
    """A dropped bar with an attached mass neither turns nor strains: the mass's weight and inertia act at one point."""
    falling = loaded(moving, loads={"weight": {"gravity": [0, 0, -9.81]}}, handles={})
    result = falling.step(dt=0.02)
    fallen = np.broadcast_to([0.0, 0.0, -0.5 * 9.81 * 0.02**2], falling.mesh.vertices.shape)
    np.testing.assert_allclose(result.positions - falling.mesh.vertices, fallen, atol=1e-11)
    assert falling.imus()["camera"].linear_acceleration == pytest.approx([0.0, 0.0, 0.0], abs=1e-6)

# SPDX-License-Identifier: Apache-2.0
"""A body without handles falls, flies and spins as mechanics predicts."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from gdfe_ros import Simulation
from gdfe_ros.solver.motion.inertia import mass_matrix
from test.written import advance

MASS = 1000.0 * 0.1 * 0.02 * 0.02


def momenta(simulation: Simulation, mass: csr_matrix) -> tuple[np.ndarray, np.ndarray]:
    """Return linear momentum [N s] and angular momentum [N m s] about the centre of mass."""
    x, v = simulation.positions, mass @ simulation.result.velocities
    centre = np.asarray(mass.sum(axis=0)).ravel() @ x / mass.sum()
    return v.sum(axis=0), np.cross(x - centre, v).sum(axis=0)


@pytest.mark.exact("no iteration is left to do without a shift")
@pytest.mark.parametrize("scheme", ["newmark", "generalised_alpha"])
def test_a_thrown_body_flies_a_parabola(moving: Callable, scheme: str) -> None:
    """Every vertex of a thrown body flies its parabola to rounding, without an iteration and without strain."""
    weight = {"weight": {"gravity": [0, 0, -9.81]}}
    thrown = moving(handles={}, loads=weight, dynamics__velocity=[1.0, 0.0, 2.0], dynamics__scheme=scheme)
    for _ in range(50):
        result = advance(thrown)
        assert result.iterations == 0
    t = result.time
    flown = result.positions - thrown.mesh.vertices
    np.testing.assert_allclose(flown, np.broadcast_to([t, 0.0, 2.0 * t - 0.5 * 9.81 * t * t], flown.shape), atol=1e-11)
    assert result.energies["elastic"] < 1e-12
    energy = result.energies["kinetic"] + result.energies["potential"]
    assert energy == pytest.approx(0.5 * MASS * 5.0, rel=1e-9)


@pytest.mark.parametrize(
    "handle",
    [
        {"where": {"face": "y-"}, "slide": ["x", "z"]},
        {"where": {"face": "x-"}, "free": ["x"]},
        {"where": {"box": {"x": [0.0, 0.05]}}, "free": ["x", "y", "z", "rx", "ry", "rz"]},
    ],
)
def test_the_initial_velocity_moves_handles_along_free_axes(moving: Callable, handle: dict) -> None:
    """A body that starts along the free axis of rollers or of a handle keeps its velocity, and is not strained.

    Vertices of handles started at rest: with half of the body in a free handle, it moved half as far.
    """
    slid = moving(handles={"guide": handle}, dynamics__velocity=[0.5, 0.0, 0.0], dynamics__scheme="newmark")
    result = advance(slid, count=50)
    assert result.positions[:, 0] - slid.mesh.vertices[:, 0] == pytest.approx(0.5 * result.time, rel=1e-5)
    assert result.energies["elastic"] < 1e-9


def test_a_hinge_starts_with_its_part_of_the_spin(moving: Callable) -> None:
    """A body that spins about the axis of its hinge keeps its angular momentum, about this axis, to 0.1 %."""
    hinge = {"hinge": {"where": {"box": {"x": [0.04, 0.06]}}, "free": ["rz"]}}
    spun = moving(handles=hinge, dynamics__spin=[0.0, 0.0, 5.0], dynamics__step=0.001)
    mass = mass_matrix(spun.mesh.vertices, spun.mesh.cells, np.full(spun.mesh.n_cells, 1000.0))
    advance(spun, count=100)
    assert momenta(spun, mass)[1][2] == pytest.approx(MASS * (0.1**2 + 0.02**2) / 12.0 * 5.0, rel=1e-3)


def test_the_first_step_of_bdf2_costs_its_parabola_once(moving: Callable) -> None:
    """A body dropped by `bdf2` has only the position error of its first step, which is made by backward Euler."""
    dropped = moving(handles={}, loads={"weight": {"gravity": [0, 0, -9.81]}}, dynamics__scheme="bdf2")
    result = advance(dropped, count=50)
    fallen = (result.positions - dropped.mesh.vertices)[:, 2]
    assert np.abs(fallen + 0.5 * 9.81 * result.time**2).max() < 2.0 * 0.5 * 9.81 * 0.002**2
    assert result.velocities[:, 2] == pytest.approx(-9.81 * result.time, rel=1e-3)


def test_a_spinning_body_keeps_its_momenta(moving: Callable) -> None:
    """A body that spins for five turns keeps its linear momentum to rounding and its angular momentum to 0.1 %."""
    spinning = moving(handles={}, dynamics__spin=[0.0, 0.0, 20.0], dynamics__step=0.001)
    start, mesh = MASS * (0.1**2 + 0.02**2) / 12.0 * 20.0, spinning.mesh
    mass = mass_matrix(mesh.vertices, mesh.cells, np.full(mesh.n_cells, 1000.0))
    for _ in range(int(5 * 2 * np.pi / 20.0 / 0.001)):
        spinning.step()
        linear, angular = momenta(spinning, mass)
        assert np.abs(linear).max() < 1e-11 * MASS
        assert angular[2] == pytest.approx(start, rel=1e-3)


def test_a_dropped_body_sleeps_only_if_it_is_held(moving: Callable) -> None:
    """A free body that drifts slowly is solved in each step, since the least force would move it."""
    drifting = moving(handles={}, dynamics__velocity=[1e-9, 0.0, 0.0])
    for _ in range(3):
        assert "solve" not in drifting.step().skipped

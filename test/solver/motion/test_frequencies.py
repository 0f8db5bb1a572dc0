# SPDX-License-Identifier: Apache-2.0
"""Small vibrations: frequencies of a slender clamped bar against beam theory."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.sparse import csr_matrix, identity, kron
from scipy.sparse.linalg import eigsh

from gdfe_ros.solver.motion.inertia import mass_matrix

LENGTH, SIDE, YOUNG, POISSON, DENSITY = 0.5, 0.01, 1e6, 0.3, 1000.0
TORSION = 0.14057702 * 6.0
"""Saint-Venant's torsion constant of a square over its polar moment of area."""


def tangent(simulation: object) -> csr_matrix:
    """Return the undeformed tangent (3 f, 3 f) [N/m] of the f free vertices, by differences of the forces."""
    stepper = simulation.stepper
    state, free, spacing = stepper.at_rest(), stepper.body.unknowns.free, 1e-7
    columns = []
    for vertex in free:
        for axis in range(3):
            sides = []
            for sign in (spacing, -spacing):
                moved = state.positions.copy()
                moved[vertex, axis] += sign
                sides.append(stepper.equilibrium.forces(state.with_(positions=moved))[free].ravel())
            columns.append((sides[0] - sides[1]) / (2.0 * spacing))
    matrix = csr_matrix(np.array(columns))
    return 0.5 * (matrix + matrix.T)


def test_a_slender_bar_vibrates_as_beam_theory_says(moving: Callable) -> None:
    """Three bending frequencies, one of torsion and one of extension are within 1 % of theory, with one cell across."""
    bar = moving(
        mesh={"bar": {"size": [LENGTH, SIDE, SIDE], "cells": [60, 1, 1]}},
        materials={"rubber": {"law": "neo_hookean", "young": YOUNG, "poisson": POISSON, "density": DENSITY}},
        handles={"base": {"where": {"face": "x-"}, "fixed": True}},
    )
    free = bar.stepper.body.unknowns.free
    mass = mass_matrix(bar.mesh.vertices, bar.mesh.cells, np.full(bar.mesh.n_cells, DENSITY))[free][:, free]
    values = eigsh(tangent(bar).tocsc(), 30, M=kron(mass, identity(3)).tocsc(), sigma=0.0)[0]
    found = np.sqrt(values) / (2.0 * np.pi)
    wave = np.sqrt(YOUNG / DENSITY)
    bending = [b * b / (2.0 * np.pi) * wave * SIDE / np.sqrt(12.0) / LENGTH**2 for b in (1.875104, 4.694091, 7.854757)]
    twist = 0.25 / LENGTH * wave * np.sqrt(TORSION / (2.0 * (1.0 + POISSON)))
    for expected in (*bending, twist, 0.25 / LENGTH * wave):
        assert np.abs(found / expected - 1.0).min() < 0.01, expected
    assert found[:2] == pytest.approx(bending[0], rel=0.01)

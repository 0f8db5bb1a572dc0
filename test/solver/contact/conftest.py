# SPDX-License-Identifier: Apache-2.0
"""Bodies that touch something."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from gdfe_ros import Simulation
from gdfe_ros.scene.loader import scene_from_text
from gdfe_ros.solver.contact import held_pairs
from gdfe_ros.solver.contact.own_contact import OwnContact

CUBE = """
name: cube
mesh: {bar: {size: [0.1, 0.1, 0.1], cells: [4, 4, 4]}}
materials: {soft: {law: neo_hookean, young: 2.0e5, poisson: 0.45, density: 1000}}
regions: [{material: soft}]
handles: {top: {where: {face: z+}}}
obstacles: {ball: {sphere: {radius: 0.04}, at: [0.05, 0, -0.09]}}
solver: {tolerance: 1.0e-5}
"""
SLIDER = """
name: slider
mesh: {bar: {size: [0.1, 0.1, 0.04], cells: [3, 3, 2]}}
materials: {soft: {law: neo_hookean, young: 2.0e5, poisson: 0.45, density: 1000}}
regions: [{material: soft}]
handles: {}
obstacles: {floor: {plane: [0, 0, 1], at: [0, 0, -0.02], fixed: true}}
dynamics: {scheme: bdf2, step: 0.005, damping: {viscosity: 500}}
"""


def _maker(text: str) -> Callable[..., Simulation]:
    def make(**overrides: Any) -> Simulation:
        keys = {name.replace("__", "."): value for name, value in overrides.items()}
        return Simulation(scene_from_text(text, overrides=keys))

    return make


@pytest.fixture
def cube() -> Callable[..., Simulation]:
    """Give a function that makes a cube above a ball, held at its top; keyword arguments override scene keys."""
    return _maker(CUBE)


@pytest.fixture
def slider() -> Callable[..., Simulation]:
    """Give a function that makes a free slab on a floor, with dynamics; keyword arguments override scene keys."""
    return _maker(SLIDER)


@pytest.fixture
def pair_slopes() -> Callable[..., np.ndarray]:
    """Give a function that compares the forces of self-contact with differences of its energy, and returns them.

    Its arguments are the term, positions (n, 3) [m], and ``every``: each of this many forces is compared.
    """

    def compare(term: OwnContact, x: np.ndarray, every: int = 1) -> np.ndarray:
        def energy(positions: np.ndarray, force: np.ndarray) -> float:
            return held_pairs.pair_energy(positions, term.reals, term.integers, force, np.zeros(1))

        force = np.zeros_like(x)
        energy(x, force)
        np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-13 * np.abs(force).sum())
        for vertex, axis in np.argwhere(force != 0.0)[::every]:
            beside = np.zeros_like(x)
            beside[vertex, axis] = 1e-7
            above, below = (energy(x + sign * beside, np.zeros_like(x)) for sign in (1, -1))
            assert (above - below) / 2e-7 == pytest.approx(force[vertex, axis], abs=2e-5 * np.abs(force).max())
        return force

    return compare
